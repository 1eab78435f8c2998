"""The tick: exact in floating point, and common to both rates."""

from fractions import Fraction

import numpy as np
import pytest

from drake_ispace.blocks.rates import MAX_TICK, TICK_S, VISION_S, VISION_TICKS, tick_at, ticks_in

TICKS = [*range(5000), *range(MAX_TICK - 5000, MAX_TICK)]


def test_a_tick_is_5_ms_to_within_a_thousandth_of_a_microsecond():
    assert TICK_S == 0.004999999997380655
    assert abs(TICK_S - 0.005) < 3e-12


def test_the_tick_has_30_significant_bits():
    numerator = Fraction(TICK_S).numerator
    while numerator % 2 == 0:
        numerator //= 2
    assert numerator.bit_length() <= 30


def test_every_multiple_of_the_tick_is_exact():
    assert all(Fraction(k * TICK_S) == k * Fraction(TICK_S) for k in TICKS)


def test_the_step_between_neighbouring_ticks_is_the_tick():
    assert all((k + 1) * TICK_S - k * TICK_S == TICK_S for k in TICKS)


def test_with_0_005_multiples_are_not_exact():
    assert any(Fraction(k * 0.005) != k * Fraction(0.005) for k in range(5000))


def test_every_vision_instant_is_a_tick():
    assert VISION_TICKS == 19
    assert all(k * VISION_S == (19 * k) * TICK_S for k in range(MAX_TICK // 19))


def test_with_0_005_and_0_095_the_two_rates_miss_each_other():
    assert sum(k * 0.095 != (19 * k) * 0.005 for k in range(2001)) == 113


def test_tick_at_is_exact_on_multiples():
    assert all(tick_at(k * TICK_S) == k for k in TICKS)


def test_a_tick_lasts_until_just_before_the_next():
    for k in (1, 19, 4000, MAX_TICK - 1):
        assert tick_at(np.nextafter(k * TICK_S, 0.0)) == k - 1
        assert tick_at(np.nextafter(k * TICK_S, np.inf)) == k


@pytest.mark.parametrize("seconds, ticks", [(20.0, 4000), (0.095, 19), (0.0, 0), (0.0049, 1), (40000.0, 8000000)])
def test_a_duration_becomes_the_nearest_number_of_ticks(seconds, ticks):
    assert ticks_in(seconds) == ticks
