"""`drake-ispace identify`."""

import json

import numpy as np
import pytest

from drake_ispace.blocks.rates import ticks_in
from drake_ispace.cli.app import main
from drake_ispace.scenario import load_scenario
from drake_ispace.thesis.friction_data import friction_rollout, run_recording


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    scenario = load_scenario("pendulum_friction_excitation")
    rollout = friction_rollout(scenario)
    path = tmp_path_factory.mktemp("runs") / "run"
    run_recording(rollout, scenario, ticks_in(40.0), rollout.parameters).save(path)
    return path


def run(capsys, *arguments, code=0):
    with pytest.raises(SystemExit) as stopped:
        main([str(a) for a in arguments])
    out, err = capsys.readouterr()
    assert (stopped.value.code or 0) == code
    return out if code == 0 else err


@pytest.mark.parametrize("structure", ["arx", "armax", "armaxd", "iv", "pem"])
def test_it_prints_coefficients_with_intervals_and_residual_tests(folder, capsys, structure):
    data = json.loads(run(capsys, "identify", folder, "--structure", structure, "--json"))
    assert data["structure"] == structure
    assert all(row["low"] <= row["value"] <= row["high"] for row in data["coefficients"])
    assert data["friction"]["viscous_n_m_s"] == pytest.approx(0.0106, rel=0.25)
    assert [test["output"] for test in data["residual_tests"]]


def test_it_writes_a_document_and_a_picture(folder, capsys, tmp_path):
    text = run(capsys, "identify", folder, "--out", tmp_path / "found")
    assert "Coulomb" in text and "residual of theta_ddot" in text
    assert json.loads((tmp_path / "found" / "identification.json").read_text())["structure"] == "arx"
    assert (tmp_path / "found" / "convergence.png").stat().st_size > 10_000


def test_no_run_is_refused_with_one_sentence(capsys, tmp_path):
    assert run(capsys, "identify", tmp_path / "none", code=2).count("\n") == 1


def test_an_unknown_structure_is_refused(folder, capsys):
    assert "narx" in run(capsys, "identify", folder, "--structure", "narx", code=2)


def test_a_resting_recording_is_refused(folder, capsys, tmp_path):
    from drake_ispace.files.recording import Channel, load

    recording = load(folder)
    recording.channels = {
        name: Channel(c.t, c.columns, np.zeros_like(c.values))
        for name, c in recording.channels.items() if name != "kinect"
    }
    recording.save(tmp_path / "still")
    assert "does not excite" in run(capsys, "identify", tmp_path / "still", code=2)
