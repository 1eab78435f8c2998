"""What an Explanation says of the sizes that it names."""

from types import SimpleNamespace

import numpy as np
import pytest

from drake_ispace.explain.answer.describe import with_sizes
from drake_ispace.explain.answer.explanation import Estimate, NamedEffect
from stand_ins.tried import candidate

TRACK = SimpleNamespace(command=np.array([[0.1, -0.2], [0.05, 0.0]]))
CASE = SimpleNamespace(replay=SimpleNamespace(known={}), prediction=SimpleNamespace(tracks=[TRACK]))


@pytest.mark.parametrize("bump_n_m, on_bound", [(0.19, False), (0.21, True)])
def test_a_friction_beyond_every_recorded_torque_makes_no_sense(bump_n_m, on_bound):
    stribeck = candidate("stribeck_friction")
    numbers = {p.name: Estimate(0.1, (0.05, 0.2), p.unit) for p in stribeck.parameters}
    effect = NamedEffect("stribeck_friction", "transmission", [], numbers, 1.0, "")
    sizes = {stribeck: [bump_n_m, 1.0]}
    (named,) = with_sizes([effect], CASE, sizes, sizes)
    assert named.parameters["bump_n_m"].on_bound == on_bound
    assert not named.parameters["speed_rad_s"].on_bound


@pytest.mark.parametrize("delay_s, on_bound", [(0.05, False), (0.06, True), (0.06 - 6e-12, True)])
def test_a_fit_that_ends_just_inside_of_a_bound_is_on_it(delay_s, on_bound):
    delay = candidate("command_delay")
    effect = NamedEffect("command_delay", "drive", [], {"delay_s": Estimate(0.06, (0.05, 0.06), "s")}, 1.0, "")
    (named,) = with_sizes([effect], CASE, {delay: [delay_s]}, {delay: [delay_s]})
    assert delay.bounds[0][1] == 0.06 and named.parameters["delay_s"].on_bound == on_bound


@pytest.mark.parametrize("name, parameter, size, on_bound", [
    ("command_delay", "delay_s", 1e-10, False), ("torque_saturation", "limit_n_m", 1.0 / 100.0, False),
])
def test_next_to_neutral_a_size_is_on_no_bound(name, parameter, size, on_bound):
    """A limit's coordinate is one over it."""
    one = candidate(name)
    numbers = {p.name: Estimate(0.1, (0.05, 0.2), p.unit) for p in one.parameters}
    (named,) = with_sizes([NamedEffect(name, "drive", [], numbers, 1.0, "")], CASE, {one: [size]}, {one: [size]})
    assert named.parameters[parameter].on_bound == on_bound


def test_a_patch_may_reach_up_to_a_wall():
    patch = candidate("soft_patch")
    numbers = {p.name: Estimate(0.1, (0.05, 0.2), p.unit) for p in patch.parameters}
    sizes = {patch: [2.0, 0.0, patch.bounds[2][1], -0.7, 0.4, 0.05]}
    (named,) = with_sizes([NamedEffect("soft_patch", "ground", [], numbers, 1.0, "")], CASE, sizes, sizes)
    assert not any(number.on_bound for number in named.parameters.values())


def ends_of(without):
    """The interval of a mass error of 0.1 whose filter said 0.02 to 0.05, by sizes without each run."""
    mass = candidate("mass_error")
    effect = NamedEffect("mass_error", "plant", [], {"share": Estimate(0.03, (0.02, 0.05), "1")}, 1.0, "")
    (named,) = with_sizes([effect], CASE, {mass: [0.1]}, {mass: [0.1]}, [{mass: [z]} for z in without])
    return named.parameters["share"].ci90


def test_an_interval_holds_the_size_of_least_squares():
    assert ends_of([]) == (0.02, 0.1)


def test_an_interval_reaches_as_far_as_runs_disagree():
    assert ends_of([0.099, 0.101]) == pytest.approx((0.02, 0.1 + 6.314 * 0.001), abs=1e-6)
    assert ends_of([0.1, 0.1, 0.1]) == pytest.approx((0.02, 0.1))
