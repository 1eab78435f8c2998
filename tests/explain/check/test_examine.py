"""Do training and held-out runs keep their names, and is what becomes of them said?"""

import importlib
from dataclasses import replace

import numpy as np
import pytest

import drake_ispace as di
from drake_ispace.blocks.errors import InputError
from drake_ispace.explain.check.check import check
from drake_ispace.explain.check.checked import Checked
from drake_ispace.explain.check.finding import Finding
from drake_ispace.faults.repair import CutOut
from hidden import two_wheels

module = importlib.import_module("drake_ispace.explain.check.examine")
SOUND = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0, "in_step": True}


@pytest.fixture(scope="module")
def runs():
    return [two_wheels.drive(seed, 12.0, **SOUND) for seed in (3, 4, 5)]


def with_cut(monkeypatch, number, since, until):
    """Let the check find that a stretch of one run has to be cut out."""
    def found(model, runs, tell=None):
        cut = Finding(
            "robot_carried", "it was", "encoder", since, until, runs=(number,),
            repairs=(CutOut(since, until),),
        )
        return Checked([f"run {i + 1}" for i in range(len(runs))], [cut], list(runs))

    monkeypatch.setattr(module, "check", found)


def examined(runs, held_out):
    return module.examine(two_wheels.model(), runs, held_out, False, lambda text: None)


def test_a_run_keeps_its_name_where_an_earlier_one_is_cut_in_two(runs, monkeypatch):
    with_cut(monkeypatch, 0, 5.0, 6.0)
    found = examined(runs[:2], runs[2:])
    assert [run.path.name for run in found.runs] == ["run 1 from 0 s", "run 1 from 6 s", "run 2"]
    assert [run.path.name for run in found.held_out["held out"]] == ["run 3"] and not found.warnings


def test_recordings_are_called_by_the_names_that_they_are_given_by(runs):
    found = examined({"square": runs[0], "eight": runs[1]}, {"unseen": runs[2], "others": runs[:1]})
    assert found.names == ["square", "eight", "unseen", "run 4"]


def test_a_check_takes_runs_by_name(runs):
    stopped = runs[1].channels["encoder"]
    stopped = replace(stopped, values=np.where((stopped.t // 2.0 == 2.0)[:, None], stopped.values[0], stopped.values))
    spoilt = replace(runs[1], channels=runs[1].channels | {"encoder": stopped})
    assert {f.run for f in check(two_wheels.model(), {"square": runs[0], "eight": spoilt}).findings} == {"eight"}


def test_that_nothing_is_left_to_prove_on_is_said(runs, monkeypatch):
    with_cut(monkeypatch, 2, 0.0, 12.0)
    found = examined(runs[:2], runs[2:])
    assert found.held_out == {"held out": []} and not found.serious
    assert found.warnings == ["nothing is left of the held-out runs: the answer is proved without them"]


def test_without_held_out_runs_none_is_missed(runs, monkeypatch):
    with_cut(monkeypatch, 0, 5.0, 6.0)
    assert not examined(runs, ()).warnings


@pytest.mark.slow
def test_each_run_is_told_with_its_own_numbers():
    """What is alike in two runs but for its size is not told of both with the size of one."""
    hidden = di.hide("omni_multirate", "omni", {}, ["square", "circle"], 5, 8.0).values()
    clipped = []
    for run, at in zip(hidden, (0.02, 0.03), strict=True):
        torque = run.channels["torque"]
        values = np.clip(torque.values, -at, at)
        clipped.append(replace(run, channels=run.channels | {"torque": replace(torque, values=values)}))
    told = [f for f in check("omni_multirate", clipped).findings if f.fault == "channel_clipped"]
    assert [(f.run, "0.02" in f.what, "0.03" in f.what) for f in told] == [
        ("run 1", True, False), ("run 2", False, True)
    ]


@pytest.mark.parametrize("values", [lambda v: v[:, :2], lambda v: v[:-1], lambda v: v[:, 0]])
def test_values_that_are_not_one_for_each_time_and_column_are_refused(runs, values):
    command = runs[0].channels["command"]
    wrong = replace(command, values=values(command.values))
    run = replace(runs[0], channels=runs[0].channels | {"command": wrong})
    with pytest.raises(InputError, match=r"mine: channel command: .*, expected .* for the columns vx, vy, wz$"):
        check(two_wheels.model(), {"mine": run})


def test_runs_of_two_robots_are_refused(runs):
    with pytest.raises(InputError, match=r"run 2: the run is of robot 'another', expected '\w+' as run 1"):
        check(two_wheels.model(), [runs[0], replace(runs[1], robot="another")])


def test_a_finding_whose_words_are_those_of_its_kind_says_them_once():
    swapped = Finding("command_axes_swapped", "vx and vy change places", "command", run="all")
    assert str(swapped).startswith("command in all runs: vx and vy change places; repair: ")
