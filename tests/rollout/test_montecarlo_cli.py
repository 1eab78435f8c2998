"""The commands `montecarlo`, `parity`, `simulate --engine` and `draw --kernel`."""

import signal
import time

import pytest

from drake_ispace.rollout.many.table import read_campaign

SHORT = ["omni_multirate", "--seconds", "1"]
VARY = ["--vary", "omni.plant.mass_kg=normal(7.3,0.3)"]


def test_montecarlo_answers_with_the_spread(document):
    data = document("montecarlo", *SHORT, "--runs", "20", *VARY)
    assert list(data) == ["diagram", "runs", "seconds", "diverged", "metrics", "wall_s", "realtime_factor", "out",
                          "damaged"]
    assert (data["diagram"], data["runs"], data["seconds"], data["diverged"]) == ("omni_multirate", 20, 1.0, 0)
    error = data["metrics"]["rms_cross_track_m"]
    assert error["p05"] < error["median"] < error["p95"] <= error["max"]


def test_montecarlo_writes_rows_and_a_figure(document, tmp_path):
    document("montecarlo", *SHORT, "--runs", "20", *VARY, "--out", str(tmp_path))
    assert read_campaign(tmp_path).num_rows == 20
    assert (tmp_path / "montecarlo.png").read_bytes().startswith(b"\x89PNG")


def test_montecarlo_prints_a_table(said):
    table = said("montecarlo", *SHORT, "--runs", "2")
    assert "rms error [mm]" in table and "0 of 2 runs diverged" in table


def test_the_seed_changes_the_numbers(document):
    one, two = (document("montecarlo", *SHORT, "--runs", "2", "--seed", seed)["metrics"] for seed in "12")
    assert one != two


def test_parameters_are_listed_with_their_values(document):
    values = document("montecarlo", "omni_multirate", "--parameters", "--set", "omni.plant.mass_kg=8")
    assert values["omni_plant.mass_kg"] == 8.0
    assert not any("noise_stream" in name for name in values)


@pytest.mark.parametrize("words", [
    ["--runs", "0"], ["--runs", "1.5"], ["--threads", "0"], ["--vary", "mass=normal(1,2)"], ["--vary", "x"],
    ["--out", "/proc/nowhere"],
])
def test_bad_input_is_refused(refused, words):
    assert "expected" in refused("montecarlo", *SHORT, *words)


@pytest.mark.slow
def test_interrupts_keep_whole_rows(launched, tmp_path):
    """Killed, then stopped by Ctrl-C: only whole files are left, and they say how far it came."""
    words = ["montecarlo", "omni_multirate", "--seconds", "0.45", "--runs", "200000", "--out", tmp_path]
    for number in (signal.SIGKILL, signal.SIGINT):
        parts = len(list(tmp_path.glob("part-*")))
        process = launched("-m", "drake_ispace", *words)
        while len(list(tmp_path.glob("part-*"))) == parts and process.poll() is None:
            time.sleep(0.02)
        process.send_signal(number)
        said = process.communicate()[1]
    assert process.returncode == 130
    assert f"stopped after {read_campaign(tmp_path).num_rows} of 200000 runs" in said


def test_parity_answers_with_the_largest_difference(document):
    data = document("parity", *SHORT)
    assert data["max_abs_difference"] == 0.0 and data["ticks"] == 200


def test_both_engines_write_the_same_recording(document, tmp_path):
    for engine in ("drake", "compiled"):
        document("simulate", *SHORT, "--engine", engine, "--out", str(tmp_path / engine))
    files = {file.name: file.read_bytes() for file in (tmp_path / "drake").iterdir()}
    assert len(files) > 4
    assert files == {file.name: file.read_bytes() for file in (tmp_path / "compiled").iterdir()}


def test_an_unknown_engine_is_refused(refused):
    assert "compiled" in refused("simulate", *SHORT, "--engine", "steam")


def test_draw_shows_the_compiled_function(document, said):
    data = document("draw", "omni_multirate", "--kernel")
    assert data["kernel"].startswith("def rollout(") and data["dot"].startswith("digraph")
    assert said("draw", "omni_multirate", "--kernel").strip() == data["kernel"].strip()
