"""Random numbers as pure functions of (seed, stream, tick, channel)."""

import numpy as np
import pytest
from scipy.special import ndtri
from scipy.stats import kstest

from drake_ispace.blocks.noise import _splitmix, normal, normal_quantile, stream, uniform

N = 20000
FIVE_SIGMA = 5.0 / np.sqrt(N)


def draws(seed=0, name="imu", channel=0, draw=normal):
    key = stream(seed, name)
    return np.array([draw(key, tick, channel) for tick in range(N)])


@pytest.mark.parametrize("state, hashed", [(0, 0xE220A8397B1DCDAF), (1234567, 6457827717110365317)])
def test_splitmix64_gives_its_published_values(state, hashed):
    assert int(_splitmix(np.uint64(state))) == hashed


def test_the_first_numbers_of_a_stream_never_change():
    key = stream(0, "pendulum.imu")
    first = [normal(key, tick, channel) for tick in (0, 1) for channel in (0, 1)]
    assert list(key) == [3195118856.0, 1501241833.0]
    assert first == pytest.approx(
        [-0.21768572246949414, -0.7318053881186966, 0.8119656569296565, 0.7215617676920972], rel=1e-14
    )


def test_uniform_hashes_key_then_tick_then_channel():
    def splitmix(state):
        mask = 2**64 - 1
        z = (state + 0x9E3779B97F4A7C15) & mask
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & mask
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & mask
        return z ^ (z >> 31)

    key = stream(5, "omni.actuator")
    for tick, channel in ((0, 0), (1, 0), (0, 3), (2**23, 7)):
        state = int(key[0]) * 2**32 + int(key[1])
        state = splitmix(state ^ (tick * 0x9E3779B97F4A7C15 % 2**64))
        state = splitmix(state ^ (channel * 0xD1B54A32D192ED03 % 2**64))
        assert uniform(key, tick, channel) == (state // 2**12 + 0.5) / 2**52


def test_a_draw_does_not_depend_on_the_order_of_evaluation():
    key = stream(3, "omni.plant/slip")
    forward = [normal(key, tick, 1) for tick in range(100)]
    backward = [normal(key, tick, 1) for tick in reversed(range(100))]
    assert forward == backward[::-1]


def test_normal_quantile_is_accurate_to_1e_14():
    tails = [np.logspace(-300, -4, 500), 1.0 - np.logspace(-15, -4, 100)]
    for p in np.concatenate([np.linspace(1e-4, 1.0 - 1e-4, 2001), *tails]):
        assert normal_quantile(p) == pytest.approx(ndtri(p), rel=1e-14, abs=1e-16)


def test_normal_quantile_is_odd_about_one_half():
    for p in (2.0**-20, 2.0**-7, 0.0625, 0.25, 0.4375):  # 1 - p is exact
        assert normal_quantile(p) == -normal_quantile(1.0 - p)


def test_a_uniform_number_lies_strictly_between_zero_and_one():
    sample = draws(draw=uniform)
    assert sample.min() > 0.0
    assert sample.max() < 1.0


def test_uniform_numbers_are_uniform():
    assert kstest(draws(draw=uniform), "uniform").pvalue > 0.001


def test_normal_numbers_are_normal():
    assert kstest(draws(), "norm").pvalue > 0.001


def test_moments_of_a_standard_normal():
    sample = draws()
    assert abs(sample.mean()) < FIVE_SIGMA
    assert abs(np.mean(sample**2) - 1.0) < FIVE_SIGMA * np.sqrt(2.0)
    assert abs(np.mean(sample**3)) < FIVE_SIGMA * np.sqrt(15.0)
    assert abs(np.mean(sample**4) - 3.0) < FIVE_SIGMA * np.sqrt(96.0)


@pytest.mark.parametrize("other", [
    {"channel": 1}, {"channel": 2}, {"channel": 1000}, {"seed": 1}, {"seed": 2**31}, {"name": "imu2"},
    {"name": "omni.plant/slip"},
])
def test_channels_seeds_and_streams_are_independent(other):
    assert abs(np.mean(draws() * draws(**other))) < FIVE_SIGMA


@pytest.mark.parametrize("lag", [1, 2, 19, 1000])
def test_ticks_are_independent(lag):
    sample = draws()
    assert abs(np.mean(sample[lag:] * sample[:-lag])) < 5.0 / np.sqrt(N - lag)


def test_neighbouring_channels_do_not_repeat_neighbouring_ticks():
    key = stream(0, "imu")
    grid = [uniform(key, tick, channel) for tick in range(300) for channel in range(30)]
    assert len(set(grid)) == len(grid)


def test_a_key_survives_in_a_float_parameter():
    key = stream(7, "encoder")
    assert key.dtype == np.float64
    assert all(half == int(half) and 0 <= half < 2**32 for half in key)
