"""`drake-ispace identify`."""

import json

import numpy as np
import pytest

from drake_ispace.blocks.rates import ticks_in
from drake_ispace.scenario import load_scenario
from drake_ispace.thesis.friction_data import friction_rollout, run_recording


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    scenario = load_scenario("pendulum_friction_excitation")
    rollout = friction_rollout(scenario)
    path = tmp_path_factory.mktemp("runs") / "run"
    run_recording(rollout, scenario, ticks_in(40.0), rollout.parameters).save(path)
    return path


@pytest.mark.parametrize("structure", ["arx", "armax", "armaxd", "iv", "pem"])
def test_it_prints_coefficients_with_intervals_and_residual_tests(folder, document, structure):
    data = document("identify", folder, "--structure", structure)
    assert data["structure"] == structure
    assert all(row["low"] <= row["value"] <= row["high"] for row in data["coefficients"])
    assert data["friction"]["viscous_n_m_s"] == pytest.approx(0.0106, rel=0.25)
    assert [test["output"] for test in data["residual_tests"]]


def test_it_writes_a_document_and_a_picture(folder, said, tmp_path):
    text = said("identify", folder, "--out", tmp_path / "found")
    assert "Coulomb" in text and "residual of theta_ddot" in text
    assert json.loads((tmp_path / "found" / "identification.json").read_text())["structure"] == "arx"
    assert (tmp_path / "found" / "convergence.png").stat().st_size > 10_000


def test_no_run_is_refused_with_one_sentence(refused, tmp_path):
    assert refused("identify", tmp_path / "none").count("\n") == 1


def test_an_unknown_structure_is_refused(folder, refused):
    assert "narx" in refused("identify", folder, "--structure", "narx")


def test_a_resting_recording_is_refused(folder, refused, tmp_path):
    from drake_ispace.files.recording import Channel, load

    recording = load(folder)
    recording.channels = {
        name: Channel(c.t, c.columns, np.zeros_like(c.values))
        for name, c in recording.channels.items() if name != "kinect"
    }
    recording.save(tmp_path / "still")
    assert "does not excite" in refused("identify", tmp_path / "still")
