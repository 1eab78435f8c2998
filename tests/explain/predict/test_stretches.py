"""Stretches that stand for long recordings: where they lie, what they know of the time before them."""

from dataclasses import replace

import numpy as np
import pytest

import drake_ispace as di
from drake_ispace.blocks.errors import InputError
from drake_ispace.explain.predict.case import prepare
from drake_ispace.explain.predict.room_view import LEAD_TICKS, SIGHTING
from drake_ispace.explain.predict.stretches import begun, in_stretches, stretch, stretches_of
from drake_ispace.explain.predict.tracks import Track
from drake_ispace.faults.repair import rows
from drake_ispace.robots.library import robots
from hidden.generator import generate

MOTIONS = ("square", "figure_eight", "circle")


def made(seconds, name="run", rests=()):
    """A Track whose two wheels turn by 0.01 rad a tick, but rest in some spans [s]; a fix every 20 ticks at x = t."""
    ticks = int(seconds * 200)
    rows, t = ticks + LEAD_TICKS, np.arange(ticks + LEAD_TICKS) / 200.0
    turns = np.full(rows, 0.01)
    for begin, end in rests:
        turns[(t >= begin) & (t < end)] = 0.0
    sightings, fixes = np.zeros((rows, len(SIGHTING))), np.arange(0, ticks, 20)
    sightings[fixes + LEAD_TICKS] = np.column_stack(
        [np.ones(len(fixes)), t[fixes], np.zeros(len(fixes)), np.zeros(len(fixes)), np.zeros(len(fixes))]
    )
    wheels = np.repeat(np.cumsum(turns)[:, None], 2, axis=1)
    has = frozenset({"torque", "encoder", "kinect"})
    return Track(name, ticks, np.zeros((rows, 2)), wheels, sightings, fixes, t[fixes], np.zeros(3), has, np.zeros(3))


def test_all_fixes_of_a_stretch_go_with_it_and_its_clock():
    track = made(60.0)
    t = np.arange(0.0, 60.0, 0.01)
    cut = stretch(replace(track, seen=np.column_stack([t, t, t, t])), 4000, 8000, 100)
    assert cut.seen[0] == pytest.approx([0.0, 19.5, 19.5, 19.5], abs=1e-6) and len(cut.seen) == 2050


def spans(tracks):
    """(begin, end) of what is scored of each [s]."""
    return [(one.since_s + one.unscored_ticks / 200.0, one.since_s + one.ticks / 200.0) for one in tracks]


def test_short_recordings_are_used_as_they_are():
    tracks = [made(30.0), made(50.0)]
    assert stretches_of(tracks, 80.0, 2, 100) == (tracks, [])


def test_long_ones_are_represented_from_all_over_them():
    used, spare = stretches_of([made(400.0)], 100.0, 2, 100)
    found, others = spans(used), spans(spare)
    assert [end - begin for begin, end in found] == [pytest.approx(20.0)] * 5 and len(others) == 2
    assert not set(found) & set(others)
    middles = np.mean(found, axis=1)
    assert np.abs(middles - np.array([40.0, 120.0, 200.0, 280.0, 360.0])).max() < 20.0
    assert used[0].name == f"run from {found[0][0]:.0f} s"


def test_a_long_run_is_used_in_stretches_and_a_short_one_as_it_is():
    short, *parts = in_stretches([made(40.0, "short"), made(60.0, "long")], 100)
    assert short.name == "short" and short.ticks == 8000
    assert spans(parts) == [pytest.approx((begin, begin + 20.0)) for begin in (0.0, 20.0, 40.0)]


def test_several_recordings_share_the_time():
    used, _ = stretches_of([made(100.0, "a"), made(300.0, "b")], 80.0, 2, 100)
    assert [one.name[0] for one in used] == ["a", "b", "b", "b"]


def test_a_robot_at_rest_tells_little():
    used, _ = stretches_of([made(400.0, rests=[(0.0, 300.0)])], 60.0, 2, 100)
    assert min(begin for begin, _ in spans(used)) >= 280.0


def test_the_seconds_before_a_stretch_are_for_the_filter():
    one = stretch(made(60.0), 4000, 8000, 150)
    assert (one.unscored_ticks, one.settled, one.ticks, one.since_s) == (150, 150, 4150, pytest.approx(19.25))
    assert one.poses[:, 0] == pytest.approx(one.fix_t + one.since_s)  # fixes are at x = t of the recording
    assert np.array_equal(one.fix_ticks, np.round(one.fix_t * 200))
    assert one.measured[0, 0] == pytest.approx(0.01 * 3851)
    first = stretch(made(60.0), 0, 4000, 150)
    assert first.unscored_ticks == 0 and first.aim is not None and one.aim is None


@pytest.mark.parametrize("robot", ["omni", "pendulum"])
def test_after_the_lead_a_stretch_is_predicted_as_the_whole_run_is(robot):
    prediction = prepare(f"{robot}_multirate", generate(robot, "eight", {}, 20.0, 1)).prediction
    replay, whole, numbers = prediction.replay, prediction.tracks[0], prediction.replay.parameters({})
    part = stretch(whole, 2600, whole.ticks, replay.settling_ticks)
    start = np.concatenate([part.poses[0], part.measured[0, : replay.body.wheels]])
    begin = whole.ticks - part.ticks
    found, expected = replay.run(part, start, numbers)[0], replay.run(whole, prediction.starts[0], numbers)[0][begin:]
    apart, size = np.abs(found - expected).max(axis=1), expected[60:].std()
    late = apart[part.settled :]
    assert apart[:20].max() > 5.0 * late.max()
    assert late.max() < 3.0 * size  # where within its count a wheel is, no filter can know
    assert 100 < replay.settling_ticks < 1500


def test_a_log_that_begins_while_the_robot_moves_is_scored_later():
    moving, resting = made(30.0), made(30.0, rests=[(0.0, 1.0)])
    assert begun(moving, 2, 500).settled == 500 and begun(resting, 2, 500) is resting
    assert begun(made(4.0), 2, 500).settled == 400
    later = stretch(begun(moving, 2, 500), 0, 4000, 500)
    assert later.unscored_ticks == 500 and stretch(begun(moving, 2, 500), 4000, 6000, 500).unscored_ticks == 500


def test_fixes_of_an_unknown_state_are_not_scored():
    whole, part = made(60.0), stretch(made(60.0), 4000, 8000, 150)
    assert len(whole.fix_ticks[whole.scored_fixes]) == len(whole.fix_ticks) - 1  # the pose comes from the first
    scored = part.fix_ticks[part.scored_fixes]
    assert scored[0] == 150 and len(scored) == 200


@pytest.mark.slow
def test_a_sound_pendulum_lacks_nothing_in_a_log_that_begins_late():
    def late(run):
        channels = {name: channel for name, channel in run.channels.items() if name != "reference"}
        return replace(run, channels={name: rows(c, c.t >= 8.03) for name, c in channels.items()})

    square, eight, circle = map(late, di.hide("pendulum_multirate", "pendulum", {}, MOTIONS, 5, 24.0).values())
    few = [di.effects()[name] for name in ("viscous_friction", "mass_error", "accelerometer_bias")]
    assert di.explain("pendulum_multirate", [square, eight], circle, effects=few).verdict == "none"


def test_what_grows_with_time_goes_on_in_a_later_stretch():
    prediction = prepare("omni_multirate", generate("omni", "eight", {}, 10.0, 1)).prediction
    replay, (run,), values = prediction.replay, prediction.tracks, {"battery_sag_time": {"rate_per_s": 0.01}}
    numbers = replay.parameters(values)
    later = replay.since(stretch(run, 1000, 2000, 200), numbers)
    changed = np.flatnonzero(later != numbers)
    assert [replay.rollout.parameter_names[i] for i in changed] == ["omni_battery_sag_time.since_s"]
    assert later[changed] == pytest.approx([4.0]) and replay.since(run, numbers) is numbers


def test_a_wheel_at_rest_may_turn_past_the_edge_of_a_count():
    resting, count = made(30.0, rests=[(0.0, 1.0)]), 0.06
    measured = resting.measured + count * (np.arange(len(resting.measured))[:, None] > 1)
    assert begun(replace(resting, measured=measured), 2, 500).unscored_ticks == 500
    assert begun(replace(resting, measured=measured, count_rad=count), 2, 500).unscored_ticks == 0


@pytest.mark.parametrize("count", [0.02, 0.03])
def test_coarse_counts_do_not_hide_that_a_robot_moves(count):
    moving = made(30.0)
    measured = count * np.floor(moving.measured / count)
    assert begun(replace(moving, measured=measured, count_rad=count), 2, 500).unscored_ticks == 500


@pytest.mark.slow
def test_an_effect_is_found_in_stretches_and_proved_on_others():
    runs = di.hide(
        di.load_scenario("omni_multirate"), robots()["omni"].name, {"battery_sag_time": {"rate_per_s": 0.006}},
        ["figure_eight"], 3, 100.0,
    )
    few = [di.effects()[name] for name in ("battery_sag_time", "viscous_friction")]
    found = di.explain("omni_multirate", runs, effects=few, most_s=50.0)
    (effect,) = found.effects
    low, high = effect.parameters["rate_per_s"].ci90
    assert effect.name == "battery_sag_time" and low < 0.006 < high
    assert len(found.runs) == 2 and len(found.held_out) == 1
    assert "of 100 s of training runs 2 stretches, 40 s, were used" in found.warnings


def test_no_time_at_all_is_refused():
    with pytest.raises(InputError, match=r"most_s: 0\.0, expected a positive number of seconds"):
        di.explain("omni_multirate", [], most_s=0.0)


def test_a_run_that_begins_while_the_robot_moves_has_no_fixes_at_first():
    moving = begun(made(30.0), 2, 100)
    assert moving.unscored_ticks == 100 and moving.fix_ticks[0] == LEAD_TICKS
    assert np.flatnonzero(moving.sightings[:, SIGHTING.is_there])[0] == 2 * LEAD_TICKS
    assert len(moving.fix_t) == len(moving.fix_ticks)
    resting = made(30.0, rests=[(0.0, 1.0)])
    assert begun(resting, 2, 100) is resting
