"""What parity says where runs cannot be compared, and Diagrams that are built already."""

import json

import numpy as np
import pytest

from drake_ispace.rollout import engine
from drake_ispace.rollout.engine import parity, simulate_compiled
from drake_ispace.scenario import load_scenario
from drake_ispace.wiring.catalog import build_diagram


@pytest.fixture
def scenario():
    return load_scenario("omni_multirate", ["seconds=0.5"])


def test_a_diagram_that_is_built_already_is_not_built_again(scenario, monkeypatch):
    diagram, other = build_diagram(scenario), build_diagram(scenario)
    expected = simulate_compiled(scenario).signals["omni_pose"]
    monkeypatch.setattr(engine, "build_diagram", lambda scenario: pytest.fail("built again"))
    assert np.array_equal(simulate_compiled(scenario, diagram).signals["omni_pose"], expected)
    assert parity(scenario, other)["max_abs_difference"] == 0.0


@pytest.mark.parametrize("damage", ["nan", "inf", "short"])
def test_what_cannot_be_compared_is_null(damage, scenario, monkeypatch):
    run = simulate_compiled(scenario)
    pose = run.signals["omni_pose"]
    if damage == "short":
        run.signals["omni_pose"] = pose[:-1]
    else:
        pose[3, 0] = float(damage)
    monkeypatch.setattr(engine, "simulate_compiled", lambda *arguments: run)
    result = parity(scenario)
    assert result["signals"]["omni_pose"] is None and result["max_abs_difference"] is None
    assert result["signals"]["omni_torque"] == 0.0
    json.dumps(result, allow_nan=False)
