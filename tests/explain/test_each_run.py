"""An effect that one run has and the others do not."""

import dataclasses

import pytest

import drake_ispace as di
from drake_ispace.explain.decide.each_run import shown_by_one
from drake_ispace.explain.fit.candidates import candidates
from drake_ispace.explain.predict.case import prepare
from hidden import two_wheels

LATE = {"late_s": 0.05}
MARKER = {"others": {"marker_x_m": 0.03}}


def runs(hidden, where, count=4):
    """Runs of 12 s of the two-wheeled robot with something hidden in those of the numbers `where`."""
    sound = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0}
    return [
        two_wheels.drive(7000 + i, 12.0, in_step=True, **(sound | (hidden if i in where else {}))) for i in range(count)
    ]


def shown(hidden, where):
    return shown_in(runs(hidden, where))


def shown_in(recordings):
    case = prepare(two_wheels.model(), recordings)
    tried = candidates(case.effects_to_try, case.replay.body)
    return {(one.run, one.candidate.name) for one in shown_by_one(case.prediction, {}, tried, 0)}


def test_runs_of_a_sound_robot_show_nothing():
    assert not shown({}, ())


def test_what_every_run_has_is_no_matter_of_single_runs():
    assert not shown(MARKER, range(4))


def test_a_run_that_ends_as_the_robot_starts_shows_nothing():
    *others, last = runs({}, ())
    channels = {
        name: dataclasses.replace(c, t=c.t[c.t <= 2.2], values=c.values[c.t <= 2.2])
        for name, c in last.channels.items()
    }
    assert not shown_in([*others, dataclasses.replace(last, channels=channels)])


@pytest.mark.parametrize("where", [0, 3])
def test_the_run_in_which_the_marker_was_moved_is_told(where):
    assert shown(MARKER, [where]) == {(f"run {where + 1}", "marker_offset")}


def test_a_camera_that_is_late_in_the_unseen_run_only_is_not_nothing():
    *training, unseen = runs(LATE, [3])
    answer = di.explain(two_wheels.model(), training, [unseen])
    assert answer.verdict == "unknown" and not answer.effects
    assert [sentence.split(" by itself")[0] for sentence in answer.drifts] == ["run 4"]
    assert "Single runs" in answer.title
