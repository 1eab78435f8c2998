"""What a log does not have between its samples, and what a table puts there: is it told, and nothing that is sound?"""

from dataclasses import replace

import numpy as np
import pytest

import answers
from drake_ispace.explain.answer.contradiction import add_findings
from drake_ispace.explain.check.check import check
from drake_ispace.explain.check.examine import Examined
from drake_ispace.explain.check.sampling.interpolated import interpolated_fixes
from drake_ispace.explain.check.sampling.stamps import stamp_findings
from drake_ispace.faults.repair import CutOut
from drake_ispace.files.recording import Channel, Recording
from drake_ispace.scenario import load_scenario
from hidden import two_wheels
from hidden.generator import generate

SOUND = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0, "in_step": True}


@pytest.fixture(scope="module", params=["omni", "pendulum"])
def run(request):
    return generate(request.param, "eight", seconds=8.0, seed=41)


@pytest.fixture(scope="module")
def rover():
    return two_wheels.drive(3, 20.0, **SOUND)


def with_samples(run, name, t, values):
    channel = replace(run.channels[name], t=t, values=values, period_s=None)
    return replace(run, channels=run.channels | {name: channel})


def kept(run, name, which):
    channel = run.channels[name]
    return with_samples(run, name, channel.t[which], channel.values[which])


def held(run, name, every):
    channel = run.channels[name]
    return with_samples(run, name, channel.t, channel.values[np.arange(len(channel.t)) // every * every])


def at_random(run, name, lost):
    return np.random.default_rng(5).uniform(size=len(run.channels[name].t)) >= lost


def model_of(run):
    return f"{'omni' if run.channels['encoder'].values.shape[1] == 4 else 'pendulum'}_multirate"


def found(run, model=None):
    return check(model or model_of(run), [run])


@pytest.mark.first_case
@pytest.mark.parametrize("every", [2, 4, 8])
def test_a_torque_that_is_logged_more_rarely_than_it_is_set_is_serious(run, every):
    assert [f.fault for f in found(kept(run, "torque", slice(None, None, every))).serious] == ["undersampled"]


def test_an_imu_that_is_logged_or_read_more_rarely_than_the_controller_uses_it_is_serious():
    run = generate("pendulum", "circle", seconds=8.0, seed=42)
    for changed in (kept(run, "imu", slice(None, None, 2)), held(run, "imu", 2)):
        assert [(f.fault, f.channel) for f in found(changed).serious] == [("undersampled", "imu")]


@pytest.mark.first_case
@pytest.mark.parametrize("lost", [0.0, 0.01, 0.06, 0.3])
def test_torques_that_are_lost_now_and_then_are_told_and_no_reason_to_stop(run, lost):
    checked = found(kept(run, "torque", at_random(run, "torque", lost)))
    assert [f.fault for f in checked.findings] == (["steps_missing"] if lost > 0.02 else []) and not checked.serious


@pytest.mark.first_case
@pytest.mark.parametrize("lost", [0.5, 0.7])
@pytest.mark.parametrize("name", ["encoder", "kinect"])
def test_where_rows_are_lost_at_random_true_stamps_are_left_alone(run, name, lost):
    assert not found(kept(run, name, at_random(run, name, lost))).findings


@pytest.mark.parametrize("together, count", [(80, 1200), (60, 800), (10, 1200), (5, 30)])
def test_samples_that_come_at_once_are_told_however_many(together, count):
    t = 0.005 * np.arange(count)
    stamped = t[np.minimum(np.arange(count) // together * together + together - 1, count - 1)]
    stamped = stamped + 1e-5 * np.arange(count)
    bursts = Recording("omni", channels={"encoder": Channel(stamped, ("a",), t[:, None])})
    assert [finding.fault for finding in stamp_findings(bursts)] == ["bursts"]


def test_samples_that_come_at_once_before_and_after_a_gap_are_not_evened_over_it():
    t = 0.005 * np.arange(1200)
    stamped = t[np.arange(1200) // 10 * 10 + 9] + 1e-5 * np.arange(1200) + 3.0 * (t >= 3.0)
    found = list(stamp_findings(Recording("omni", channels={"encoder": Channel(stamped, ("a",), t[:, None])})))
    assert found and "bursts" not in {finding.fault for finding in found}


@pytest.mark.parametrize("pauses_s", [[600.0], [600.0, 300.0], [3.0] * 20])
def test_a_log_that_pauses_has_gaps_and_no_bursts(pauses_s):
    steps = np.full(100 * (len(pauses_s) + 1), 0.02)
    steps[100 * np.arange(1, len(pauses_s) + 1)] = pauses_s
    paused = Recording("omni", channels={"encoder": Channel(np.cumsum(steps), ("a",), np.cumsum(steps)[:, None])})
    assert [finding.fault for finding in stamp_findings(paused)] == ["rows_missing"] * len(pauses_s)


@pytest.mark.parametrize("name", ["encoder", "torque", "imu"])
def test_a_pace_that_varies_is_no_jitter_and_stamps_that_come_late_at_random_are(name):
    rng, count = np.random.default_rng(7), 2000
    own_pace = np.cumsum(rng.uniform(0.001, 0.009, count))
    late = 0.005 * np.arange(count) + rng.uniform(0.0, 0.005, count)
    told = [
        [f.fault for f in stamp_findings(Recording("omni", channels={name: Channel(t, ("a",), t[:, None])}))]
        for t in (own_pace, late)
    ]
    assert told == [[], ["stamp_jitter"]]


def test_a_torque_that_repeats_in_step_may_have_been_another_in_between(run):
    (finding,) = found(held(run, "torque", 4)).findings
    assert (finding.fault, finding.what) == ("steps_missing", "the same as before at 75 % of the ticks")


@pytest.mark.first_case
@pytest.mark.parametrize("name", ["encoder", "torque"])
def test_angles_that_are_read_rarely_and_torques_that_are_logged_often_are_sound(run, name):
    channel = run.channels[name]
    if name == "encoder":
        changed = kept(run, name, slice(None, None, 4))
    else:
        t = (channel.t[:, None] + np.arange(5) * 1e-3).ravel()
        changed = with_samples(run, name, t, np.repeat(channel.values, 5, axis=0))
    assert not found(changed).findings


@pytest.mark.slow
def test_a_torque_in_steps_of_a_second_is_known_at_every_tick():
    run = generate("omni", "eight", seconds=8.0, seed=43)
    steps = np.sin(np.floor(run.channels["torque"].t))[:, None] * np.full(4, 0.1)
    rare = kept(with_samples(run, "torque", run.channels["torque"].t, steps), "torque", slice(None, None, 4))
    assert "undersampled" not in {f.fault for f in found(rare).findings}


@pytest.mark.first_case
@pytest.mark.parametrize("fault", ["steps_missing", "samples_held"])
def test_beside_steps_that_are_missing_nothing_is_named_for_certain(run, fault):
    findings = [replace(finding, fault=fault) for finding in found(held(run, "torque", 4)).findings]
    answer = answers.named(load_scenario("omni_multirate"))
    add_findings(answer, Examined(["a"], 1, findings, [], [], {}))
    assert (answer.verdict == "incomplete") == (fault == "steps_missing")


@pytest.mark.first_case
@pytest.mark.parametrize(("lasts_s", "parts"), [(0.4, 1), (1.2, 2)])
def test_a_long_gap_cuts_a_run_in_two(lasts_s, parts):
    run = generate("omni", "eight", seconds=12.0, seed=44)
    for name in ("torque", "encoder"):
        t = run.channels[name].t
        run = kept(run, name, (t < 5.0) | (t > 5.0 + lasts_s))
    checked = found(run)
    assert {f.fault for f in checked.findings} == {"rows_missing"} and not checked.serious
    assert any(isinstance(r, CutOut) for f in checked.findings for r in f.repairs) == (parts == 2)
    assert len(checked.masked([run])[0]) == parts


def interpolated(run, every_s, digits=None):
    kinect = run.channels["kinect"]
    t = np.arange(kinect.t[0], kinect.t[-1], every_s)
    values = np.column_stack([np.interp(t, kinect.t, np.unwrap(column)) for column in kinect.values.T])
    values[:, 2] = np.mod(values[:, 2] + np.pi, 2.0 * np.pi) - np.pi
    return with_samples(run, "kinect", t, values if digits is None else np.round(values, digits))


@pytest.mark.first_case
@pytest.mark.parametrize("digits", [None, 9, 6])
def test_fixes_that_a_table_interpolates_are_left_out_but_for_those_at_the_bends(rover, digits):
    every = interpolated(rover, 0.01, digits)
    checked = found(every, two_wheels.model())
    (finding,) = [f for f in checked.findings if f.channel == "kinect"]
    assert finding.fault == "samples_interpolated" and not checked.serious
    after, before = checked.repaired[0].channels["kinect"], rover.channels["kinect"]
    assert len(after.t) == pytest.approx(len(before.t), rel=0.02)
    assert np.abs(before.t[:, None] - after.t).min(axis=1).max() < 0.01


def test_interpolated_fixes_of_a_noisy_camera_are_of_no_other_run():
    run = interpolated(generate("pendulum", "back_and_forth", seconds=12.0, seed=203), 0.02)
    assert [f.fault for f in found(run).findings] == ["samples_interpolated"]


@pytest.mark.first_case
@pytest.mark.parametrize("every_s", [0.01, 0.004])
def test_bends_that_rounding_hides_keep_their_fixes(run, every_s):
    checked = found(interpolated(run, every_s, 4))
    assert [f.fault for f in checked.findings] == ["samples_interpolated"]
    after, before = checked.repaired[0].channels["kinect"], run.channels["kinect"]
    assert len(after.t) == pytest.approx(len(before.t), rel=0.05)
    assert np.abs(before.t[:, None] - after.t).min(axis=1).max() < 2.0 * every_s


@pytest.mark.first_case
@pytest.mark.parametrize("every_s", [0.04, 0.01, 0.004])
def test_noise_that_is_spread_over_rows_makes_no_stranger_of_a_camera(run, every_s):
    """Rounded to 1 mm hardly a bend shows, and from row to row hardly any noise."""
    names = {f.fault for f in found(interpolated(run, every_s, 3)).findings}
    assert names <= {"samples_interpolated", "samples_smoothed"}


@pytest.mark.parametrize("noise_m", [0.0, 0.0002, 0.002])
def test_fixes_of_a_fast_camera_are_not_interpolated(noise_m):
    t, generator = 0.01 * np.arange(2000), np.random.default_rng(7)
    place = np.column_stack([np.sin(0.5 * t), np.sin(0.8 * t + 1.0), 0.0 * t])
    values = np.round(place + noise_m * generator.standard_normal(place.shape), 4)
    run = Recording("mine", "velocity_base", {"kinect": Channel(t, ("x", "y", "phi"), values)}, "")
    assert not list(interpolated_fixes(run))


def test_fixes_of_a_robot_that_goes_straight_on_are_not_interpolated():
    t = 0.01 * np.arange(500)
    straight = np.column_stack([0.3 * t, 0.1 * t, 0.0 * t])
    turned = np.column_stack([0.3 * np.minimum(t, 2.5), 0.3 * np.maximum(t - 2.5, 0.0), 0.0 * t])
    for values in (straight, turned):
        run = Recording("mine", "velocity_base", {"kinect": Channel(t, ("x", "y", "phi"), values)}, "")
        assert not list(interpolated_fixes(run))


COURSES = {
    "ahead": lambda t, place: np.diff(place, axis=0, append=place[-1:]),
    "behind": lambda t, place: np.diff(place, axis=0, prepend=place[:1]),
    "both": lambda t, place: np.gradient(place, axis=0),
    "by time": lambda t, place: np.gradient(place, t, axis=0),
}


@pytest.mark.first_case
@pytest.mark.parametrize("how", COURSES)
def test_headings_that_are_directions_of_motion_are_told(run, rover, how):
    for one, model in ((run, None), (rover, two_wheels.model())):
        kinect = one.channels["kinect"]
        t = kinect.t + np.random.default_rng(1).uniform(-2e-3, 2e-3, len(kinect.t))
        way = COURSES[how](t, kinect.values[:, :2])
        values = kinect.values.copy()
        values[:, 2] = np.arctan2(way[:, 1], way[:, 0])
        checked = found(with_samples(one, "kinect", t, values), model)
        assert [f.fault for f in checked.findings] == ["heading_is_course"]


def test_a_robot_that_only_goes_ahead_has_a_heading(rover):
    assert not found(rover, two_wheels.model()).findings
