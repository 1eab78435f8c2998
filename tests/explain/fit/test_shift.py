"""Where the fit of a shift in time begins: the deviance may dip between any two ticks."""

from types import SimpleNamespace

import numpy as np
import pytest

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.effects.card import Parameter
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.shift import with_best_shift
from stand_ins.linear import Made

DELAY = Candidate(Made("delay", 0.0), (), (Parameter("delay_s", "s", low=0.0, high=0.06, shifts=True),))


def read_every(ticks):
    return SimpleNamespace(reads=np.arange(0, 10 * ticks, ticks))


def best(deviance, start: float = 0.0, reads: int = 1) -> float:
    """The best shift in ticks, from `start`; deviance: of a delay in ticks; reads: ticks from one to the next."""
    likelihood = SimpleNamespace(
        whitened=lambda point: np.array([point[DELAY][0] / TICK_S]), deviance=lambda w: float(deviance(w[0])),
        prediction=SimpleNamespace(tracks=[read_every(40), read_every(reads)]),
    )
    return with_best_shift(likelihood, {DELAY: [start * TICK_S]}, DELAY)[DELAY][0] / TICK_S


def between_ticks(values, bends):
    """A deviance with these values at ticks 0, 1, ..., each stretch between two a parabola that bends so much."""
    def deviance(ticks):
        k = min(int(ticks), len(bends) - 1)
        share = ticks - k
        return (1.0 - share) * values[k] + share * values[k + 1] - bends[k] * share * (1.0 - share)

    return deviance


def test_a_narrow_dip_behind_a_shallow_one_is_found():
    deviance = between_ticks([0.0, 10.0, *range(500, 1600, 100)], [60.0, 4000.0, *[10.0] * 10])
    assert best(deviance) == pytest.approx(1.0 + 0.5 - 0.5 * (500.0 - 10.0) / 4000.0)


def test_a_deviance_that_only_grows_leaves_the_delay_at_zero():
    assert best(lambda ticks: ticks) == 0.0


def test_delays_at_which_the_model_runs_away_are_left_out():
    assert best(lambda ticks: (ticks - 0.7) ** 2 if ticks <= 1.0 else np.inf) == pytest.approx(0.7)


def test_a_delay_that_does_better_stays():
    assert best(lambda ticks: abs(ticks - 2.2), start=2.2) == pytest.approx(2.2)


@pytest.mark.parametrize("reads", [2, 4, 5, 7, 20])
@pytest.mark.parametrize("delay", [0.0, 0.3, 3.7, 8.0, 12.0])
def test_of_rare_reads_the_best_delay_is_found_between_them(reads, delay):
    """Where there is a dip in every tick of a valley that is as wide as all delays."""
    def rippled(ticks):
        return 100.0 * (ticks - delay) ** 2 + 10.0 * np.sin(np.pi * (ticks - delay)) ** 2

    looked_at = []
    assert best(lambda ticks: looked_at.append(ticks) or rippled(ticks), reads=reads) == pytest.approx(delay, abs=0.1)
    assert max(looked_at) <= 12.0 + 1e-6  # what a delay remembers


def test_of_rare_reads_few_delays_are_looked_at():
    looked_at = []
    best(lambda ticks: looked_at.append(ticks) or (ticks - 3.0) ** 2, reads=3)
    assert len(looked_at) <= (12 / 3 + 2) + (4 * 3 + 1) + 2


@pytest.mark.parametrize("nothing", [np.nan, np.inf])
def test_of_rare_reads_delays_at_which_the_model_runs_away_are_left_out(nothing):
    assert best(lambda ticks: (ticks - 0.7) ** 2 if ticks <= 4.0 else nothing, reads=4) == pytest.approx(0.7)
