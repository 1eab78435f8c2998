"""Encoders that are read less often than once a tick are compared where they were read."""

from dataclasses import replace

import numpy as np
import pytest

import drake_ispace as di
from drake_ispace.explain.predict.case import prepare
from drake_ispace.explain.predict.stretches import stretch
from drake_ispace.hiding import hide
from hidden import two_wheels


def runs(count, seconds, **hidden):
    exact = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0, "in_step": True}
    return [two_wheels.drive(60 + i, seconds, **exact | hidden) for i in range(count)]


def prediction(**hidden):
    return prepare(two_wheels.model(), runs(1, 6.0, **hidden)).prediction


def test_rows_are_the_reads_and_nothing_is_shown_between_them():
    found = prediction()
    (track,), (residuals,) = found.tracks, found.residuals({})
    assert found.row_ticks == 4 and np.array_equal(track.reads[:3], [0, 4, 8])
    assert np.isfinite(track.shown[:9]).all(axis=1).tolist() == [True, *[False] * 3] * 2 + [True]
    scored = track.reads[(track.reads >= 60) & (track.reads < track.ticks)]
    assert np.array_equal(track.scored_ticks, scored) and len(residuals["motion"]) == len(scored)


def test_a_part_of_a_run_has_its_own_reads():
    (whole,) = prediction().tracks
    part = stretch(whole, 402, 802, 0)
    assert part.reads[0] == 2 and part.reads[-1] < len(part.measured)
    assert np.array_equal(part.shown[:396], whole.shown[402:798], equal_nan=True)


def test_a_command_that_steps_between_reads_leaves_no_more_than_rounding():
    """The straight line from read to read would be off by more at steps."""
    late = prediction(others={"delay_s": 0.032})
    (residuals,) = late.residuals({"velocity_delay": {"delay_s": 0.032}})
    assert np.abs(residuals["motion"]).max() < 3.0 * 2.0 * np.pi / two_wheels.COUNTS


def test_a_robot_under_torque_and_reads_at_every_tick_are_left_as_they_are():
    assert prediction(encoder_hz=200.0).tracks[0].reads is None
    run = hide(di.load_scenario("omni_multirate"), "omni", {}, ["square"], 0, 4.0)["square"]
    assert prepare("omni_multirate", [run]).prediction.tracks[0].reads is None


@pytest.mark.slow
@pytest.mark.parametrize("encoder_hz", [50.0, pytest.param(200.0, marks=pytest.mark.slow)])
def test_a_late_command_is_not_taken_for_a_lag(encoder_hz):
    some = runs(3, 8.0, encoder_hz=encoder_hz, others={"delay_s": 0.064})
    effects = [di.effects()[name] for name in ("velocity_lag", "velocity_delay", "velocity_gain")]
    answer = di.explain(two_wheels.model(), some, effects=effects)
    (effect,) = answer.effects
    assert answer.verdict == "set" and (effect.name, effect.faults) == ("velocity_delay", ["clock_offset"])
    assert effect.parameters["delay_s"].estimate == pytest.approx(0.064, abs=0.003)


@pytest.mark.first_case
@pytest.mark.parametrize("left_share", [0.0, 0.05])
def test_a_few_fixes_are_fewer_than_what_could_explain_them(left_share):
    some = runs(2, 6.0, left_share=left_share)
    for run in some:
        del run.channels["command"]  # so that one fix a second is used
    answer = di.explain(two_wheels.model(), some)
    named = [{effect.name, *effect.equivalents} for effect in answer.effects]
    assert answer.verdict == ("set" if left_share else "none")
    assert len(named) == (left_share > 0.0) and all("single_wheel_radius_error" in names for names in named), answer


def test_a_tick_has_the_mean_of_a_velocity_that_changes_within_it_and_the_last_one_is_held():
    (run,) = runs(1, 6.0)
    command = run.channels["command"]
    t = command.t.copy()
    t[200] -= 0.0035
    values = np.where(np.arange(len(t)) < 200, 0.1, 0.3)[:, None] * [1.0, 0.0, 0.0]
    moved = replace(run, channels=run.channels | {"command": replace(command, t=t, values=values)})
    (track,) = prepare(two_wheels.model(), [moved]).prediction.tracks
    assert track.command[798:802, 0] == pytest.approx([0.1, 0.24, 0.3, 0.3], abs=1e-6)
    assert track.command[-1, 0] == pytest.approx(0.3)
