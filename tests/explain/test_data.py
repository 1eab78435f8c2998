"""What the data's own mistakes make of the answer of `explain`."""

from dataclasses import replace

import pytest

import drake_ispace as di
from drake_ispace.explain.explain import explain
from drake_ispace.hiding import hide

MODEL = "omni_multirate"


@pytest.fixture(scope="module")
def effects():
    return [di.effects()[name] for name in ("wheel_radius_error", "viscous_friction", "camera_latency")]


@pytest.fixture(scope="module")
def runs():
    radius = {"wheel_radius_error": {"share": 0.04}}
    return list(hide(MODEL, "omni", radius, ["square", "circle", "figure_eight"], 5, 8.0).values())


def with_kinect(run, change):
    kinect = run.channels["kinect"]
    values = kinect.values.copy()
    change(kinect.t, values)
    return replace(run, channels=run.channels | {"kinect": replace(kinect, values=values)})


def in_millimetres(t, values):
    values[:, :2] *= 1e3


def pushed(t, values):
    values[t > 5.0, 0] += 0.6


def test_no_physics_is_blamed_for_millimetres(runs, effects):
    answer = explain(MODEL, [with_kinect(run, in_millimetres) for run in runs[:2]], effects=effects)
    assert answer.verdict == "data" and answer.effects == []
    assert answer.to_data()["data"][0]["fault"] == "wrong_unit" and "places in mm" in str(answer)


@pytest.mark.slow
def test_a_run_that_is_given_twice_is_said_to_prove_nothing(runs, effects):
    answer = explain(MODEL, runs[:2], runs[1:], effects=effects)
    assert [text for text in answer.warnings if "again" in text] == [
        "run 3 is run 2 again: it proves nothing, and counts as if it were another one"
    ]


@pytest.mark.slow
def test_trusted_data_are_used_and_the_finding_stands_first(runs, effects):
    answer = explain(MODEL, [with_kinect(run, in_millimetres) for run in runs[:2]], effects=effects, trust_data=True)
    assert answer.verdict != "data" and "places in mm" in str(answer).splitlines()[1]


@pytest.mark.slow
def test_a_stretch_is_cut_out_and_the_rest_is_explained(runs, effects):
    answer = explain(MODEL, [with_kinect(runs[0], pushed), runs[1]], runs[2], effects=effects)
    assert [effect.name for effect in answer.effects] == ["wheel_radius_error"]
    assert answer.effects[0].parameters["share"].estimate == pytest.approx(0.04, rel=0.15)
    assert answer.data[0].limited and "camera_jump" in {finding.fault for finding in answer.data}


@pytest.mark.slow
def test_a_late_camera_may_be_a_clock(effects):
    late = hide(MODEL, "omni", {"camera_latency": {"latency_s": 0.08}}, ["square", "trapezium", "square"], 5, 8.0)
    *training, held_out = late.values()
    answer = explain(MODEL, training, held_out, effects)
    assert answer.verdict == "set" and answer.effects[0].faults == ["clock_offset"]
