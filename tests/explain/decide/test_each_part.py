"""An effect that one run has and the others do not."""

import dataclasses
import importlib

import numpy as np
import pytest

import drake_ispace as di
from drake_ispace.explain.check.examine import examine
from drake_ispace.explain.decide.each_part import shown_by_half, shown_by_run
from drake_ispace.explain.decide.survey.survey import survey
from drake_ispace.explain.fit.candidates import candidates
from drake_ispace.explain.predict.case import prepare
from hidden import two_wheels
from hidden.generator import generate

LATE = {"late_s": 0.05}
MARKER = {"others": {"marker_x_m": 0.03}}
RUNS = [f"run {i + 1}" for i in range(4)]


def runs(hidden, where, count=4):
    """Runs of 12 s of the two-wheeled robot with something hidden in those of the numbers `where`."""
    sound = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0}
    return [
        two_wheels.drive(7000 + i, 12.0, in_step=True, **(sound | (hidden if i in where else {}))) for i in range(count)
    ]


def shown(hidden, where):
    return shown_in(runs(hidden, where))


def shown_in(recordings):
    return {(one.part, one.candidate.name) for one in found_in(recordings)}


def found_in(recordings, sound_others=False):
    case = prepare(two_wheels.model(), recordings)
    tried = candidates(case.effects_to_try, case.replay.body)
    return shown_by_run(case.prediction, {}, tried, 0, sound_others=sound_others)


def until(end_s, recording):
    channels = {
        name: dataclasses.replace(c, t=c.t[c.t <= end_s], values=c.values[c.t <= end_s])
        for name, c in recording.channels.items()
    }
    return dataclasses.replace(recording, channels=channels)


def test_runs_of_a_sound_robot_show_nothing():
    assert not shown({}, ())


@pytest.mark.slow
def test_a_change_of_the_command_whose_moment_is_not_known_is_no_effect():
    sound = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0}
    recordings = [two_wheels.drive(seed, 20.0, **sound) for seed in (100, 101, 104)]
    examined = examine(two_wheels.model(), recordings, (), False, lambda said: None)
    assert {finding.fault for finding in examined.findings} == {"command_moments"}
    assert not shown_in(examined.runs)


def test_a_run_in_which_nothing_is_scored_shows_nothing():
    """Where some run has no command, wheels lead the model to the fixes, and one without fixes has nothing to show."""
    blind, untold, whole = runs(LATE, range(3), 3)
    for recording, channel in ((blind, "kinect"), (untold, "command")):
        recording.channels.pop(channel)
    case = prepare(two_wheels.model(), [blind, untold, whole])
    tried = candidates({"camera_latency": case.effects_to_try["camera_latency"]}, case.replay.body)
    known = survey(case.prediction, {}, tried).view
    assert [shown_by_run(case.prediction, {}, tried, 0, view) for view in (None, known)] == [[], []]


@pytest.mark.slow
def test_what_every_run_has_is_no_matter_of_single_runs():
    assert not shown(MARKER, range(4))


@pytest.mark.slow
def test_a_run_that_ends_as_the_robot_starts_shows_nothing():
    *others, last = runs({}, ())
    assert not shown_in([*others, until(2.2, last)])


@pytest.mark.slow
def test_two_seconds_of_motion_tell_that_the_camera_is_late():
    *others, last = runs(LATE, [3])
    assert shown_in([*others, until(4.0, last)]) == {("run 4", "camera_latency")}


@pytest.mark.slow
def test_what_explains_as_much_of_a_run_is_told_too():
    *others, last = runs(MARKER, [3])
    (one,) = found_in([*others, until(4.0, last)])
    assert {one.candidate.name, *(candidate.name for candidate in one.alike)} >= {"marker_offset", "cornering_slip"}


@pytest.mark.slow
def test_a_view_of_all_runs_serves_for_each():
    case = prepare(two_wheels.model(), runs(MARKER, [0]))
    tried = candidates(case.effects_to_try, case.replay.body)
    known = survey(case.prediction, {}, tried).view
    (one,), (other,) = (shown_by_run(case.prediction, {}, tried, 0, view) for view in (None, known))
    assert (one.part, one.candidate) == (other.part, other.candidate)
    assert other.z == pytest.approx(one.z, abs=1e-3)


@pytest.mark.parametrize("where", [pytest.param(0, marks=pytest.mark.slow), 3])
def test_the_run_in_which_the_marker_was_moved_is_told(where):
    assert shown(MARKER, [where]) == {(f"run {where + 1}", "marker_offset")}


@pytest.mark.slow
@pytest.mark.parametrize("moved, are_told", [((3,), True), ((2, 3), False)], ids=["a minority", "half of them"])
def test_single_runs_are_no_answer_for_all_unless_the_others_are_sound(moved, are_told):
    assert bool(found_in(runs(MARKER, moved), sound_others=True)) is are_told


@pytest.mark.slow
def test_a_camera_that_is_late_in_the_unseen_run_only_has_another_clock_there():
    *training, unseen = runs(LATE, [3])
    some = [di.effects()[name] for name in ("camera_latency", "marker_offset", "constant_slip")]
    answer = di.explain(two_wheels.model(), training, [unseen], some)
    assert answer.verdict == "none" and not answer.drifts
    assert [(one.fault, one.run) for one in answer.data if one.channel == "kinect"] == [("clock_offset", "run 4")]


@pytest.mark.slow
def test_a_marker_that_was_moved_before_the_unseen_run_only_is_not_nothing():
    *training, unseen = runs(MARKER, [3])
    some = [di.effects()[name] for name in ("camera_latency", "marker_offset", "constant_slip")]
    answer = di.explain(two_wheels.model(), training, [unseen], some)
    assert answer.verdict == "unknown" and not answer.effects
    assert [sentence.split(" by itself")[0] for sentence in answer.drifts] == ["run 4"]
    assert "part of the runs" in answer.title


@pytest.mark.slow
def test_a_limit_of_a_thousand_metres_per_second_squared_is_nothing():
    sound, slips = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0}, {"slip_share": 0.0324}
    case = prepare(two_wheels.model(), [
        two_wheels.drive(60400 + i, 20.0, **sound, others=slips, in_step=True) for i in range(3)
    ])
    tried = candidates(case.effects_to_try, case.replay.body)
    (room,) = (one for one in tried if one.name == "camera_scale")  # which is to wheels what slip is
    assert not shown_by_run(case.prediction, {room: [-0.0323]}, tried, 0)


def halves_of(recordings):
    """Which half of all runs shows which effect."""
    case = prepare(two_wheels.model(), recordings)
    found = shown_by_half(case.prediction, {}, candidates(case.effects_to_try, case.replay.body), 0)
    return {(one.part.split()[1], one.candidate.name) for one in found}


@pytest.mark.first_case
@pytest.mark.parametrize("count", [1, 2])
def test_halves_of_a_sound_robots_runs_show_nothing(count):
    assert halves_of(runs({}, (), count)) == set()


@pytest.mark.slow
def test_what_both_halves_have_is_no_matter_of_one():
    assert halves_of(runs(LATE, range(2), 2)) == set()


def test_a_camera_that_is_late_half_way_is_late_in_the_second_half():
    late = [dataclasses.replace(recording, channels=recording.channels | {
        "kinect": dataclasses.replace(camera, t=camera.t + 0.06 * (camera.t > 6.0)),
    }) for recording in runs({}, (), 2) for camera in (recording.channels["kinect"],)]
    ((half, name),) = halves_of(late)
    assert half == "second" and name in ("camera_latency", "clock_offset")


@pytest.mark.first_case
@pytest.mark.parametrize("end_s", [1.9, 2.0])
def test_halves_of_which_nothing_is_scored_are_left_alone(end_s):
    cut = []
    for recording in runs({}, (), 2):
        moving = {
            name: dataclasses.replace(c, t=c.t[c.t >= 3.0] - 3.0, values=c.values[c.t >= 3.0])
            for name, c in recording.channels.items()
        }
        cut.append(until(end_s, dataclasses.replace(recording, channels=moving)))
    assert halves_of(cut) == set()


def test_halves_without_encoders_have_nothing_though_a_camera_saw_the_robot():
    run = generate("omni", "square", {}, 6.0, 1)
    run.channels.pop("encoder")
    case = prepare("omni_multirate", [run])
    assert shown_by_half(case.prediction, {}, candidates(case.effects_to_try, case.replay.body), 0) == []


@pytest.mark.slow
def test_of_several_coordinates_the_one_that_changes_is_told():
    late = []
    for recording in runs({"others": {"marker_x_m": 0.0}}, (), 2):
        camera = recording.channels["kinect"]
        since, (x, y, phi) = camera.t > 6.0, camera.values[:, :3].T
        off = np.column_stack([-np.sin(phi), np.cos(phi)]) * 0.05 * since[:, None]
        values = np.column_stack([np.column_stack([x, y]) + off, phi + 0.06 * since, camera.values[:, 3:]])
        late.append(dataclasses.replace(recording, channels=recording.channels | {
            "kinect": dataclasses.replace(camera, values=values),
        }))
    case = prepare(two_wheels.model(), late)
    tried = candidates(case.effects_to_try, case.replay.body)
    (marker,) = (one for one in tried if one.name == "marker_offset")
    named = [3e-4, 0.025, 0.03]
    parts = [one.part for one in shown_by_half(case.prediction, {marker: named}, tried, 0)]
    assert "the second half of the runs" in parts


def test_halves_in_which_the_model_runs_away_are_left_alone(monkeypatch):
    monkeypatch.setattr(importlib.import_module(shown_by_half.__module__), "is_finite", lambda residuals: False)
    late = [
        dataclasses.replace(run, channels=run.channels | {"kinect": dataclasses.replace(camera, t=camera.t + late_s)})
        for run in runs({}, (), 2) for camera in (run.channels["kinect"],)
        for late_s in (0.06 * (camera.t > 6.0),)
    ]
    assert halves_of(late) == set()


@pytest.mark.slow
def test_a_drive_that_lags_alike_in_both_halves_does_so_although_a_lag_is_not_linear():
    named = {"velocity_lag": [0.0599, 4e-5], "clock_offset": [0.0815], "single_wheel_radius_error[2]": [0.04]}
    *training, unseen = (two_wheels.drive(i, 30.0, camera_hz=30.0) for i in range(4))
    examined = examine(two_wheels.model(), training, [unseen], False, lambda text: None)
    case = prepare(two_wheels.model(), examined.runs, examined.held_out)
    tried = candidates(case.effects_to_try, case.replay.body)
    labelled = {one.label: one for one in tried}
    assert not shown_by_half(case.prediction, {labelled[label]: z for label, z in named.items()}, tried, 0)


@pytest.mark.parametrize("largest", [pytest.param(0, marks=pytest.mark.slow), 3])
def test_an_effect_that_another_run_shows_at_another_size_is_no_matter_of_one_run(largest):
    """The marker is 6 cm aside in one run and 3 cm in another."""
    recordings = runs(MARKER, (1, 2))
    recordings[largest] = runs({"others": {"marker_x_m": 0.06}}, (largest,))[largest]
    first = next(one for one in found_in(recordings) if one.part == f"run {largest + 1}")
    assert first.candidate.name == "marker_offset" and [size.part for size in first.sizes] == RUNS
    assert {size.part for size in first.sizes if size.is_clear} == {"run 2", "run 3", f"run {largest + 1}"}
    assert first.sizes[1].value == pytest.approx(0.03, abs=0.005)


def test_a_run_that_others_do_not_resemble_has_no_sizes_elsewhere():
    (one,) = found_in(runs(MARKER, [3]))
    assert one.sizes == ()
