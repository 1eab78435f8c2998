"""The commands `montecarlo`, `parity`, `simulate --engine` and `draw --kernel`."""

import json
import signal
import subprocess
import sys
import time

import pytest

from drake_ispace.cli.app import main
from drake_ispace.rollout.table import read_campaign

SHORT = ["omni_multirate", "--seconds", "1"]
VARY = ["--vary", "omni.plant.mass_kg=normal(7.3,0.3)"]


def printed(capsys, *words):
    """What a command that succeeds prints."""
    with pytest.raises(SystemExit) as stop:
        main(words)
    said = capsys.readouterr()
    assert stop.value.code == 0 and not said.err
    return said.out


def answer(capsys, *words):
    """The JSON document that a command prints."""
    return json.loads(printed(capsys, *words, "--json"))


def test_montecarlo_answers_with_the_spread(capsys):
    data = answer(capsys, "montecarlo", *SHORT, "--runs", "20", *VARY)
    assert list(data) == ["diagram", "runs", "seconds", "diverged", "metrics", "wall_s", "realtime_factor", "out"]
    assert (data["diagram"], data["runs"], data["seconds"], data["diverged"]) == ("omni_multirate", 20, 1.0, 0)
    error = data["metrics"]["rms_cross_track_m"]
    assert error["p05"] < error["median"] < error["p95"] <= error["max"]


def test_montecarlo_writes_rows_and_a_figure(capsys, tmp_path):
    answer(capsys, "montecarlo", *SHORT, "--runs", "20", *VARY, "--out", str(tmp_path))
    assert read_campaign(tmp_path).num_rows == 20
    assert (tmp_path / "montecarlo.png").read_bytes().startswith(b"\x89PNG")


def test_montecarlo_prints_a_table(capsys):
    table = printed(capsys, "montecarlo", *SHORT, "--runs", "2")
    assert "rms error [mm]" in table and "0 of 2 runs diverged" in table


def test_the_seed_changes_the_numbers(capsys):
    one, two = (answer(capsys, "montecarlo", *SHORT, "--runs", "2", "--seed", seed)["metrics"] for seed in "12")
    assert one != two


def test_parameters_are_listed_with_their_values(capsys):
    values = answer(capsys, "montecarlo", "omni_multirate", "--parameters", "--set", "omni.plant.mass_kg=8")
    assert values["omni_plant.mass_kg"] == 8.0
    assert not any("noise_stream" in name for name in values)


@pytest.mark.parametrize("words", [
    ["--runs", "0"], ["--runs", "1.5"], ["--threads", "0"], ["--vary", "mass=normal(1,2)"], ["--vary", "x"],
    ["--out", "/proc/nowhere"],
])
def test_bad_input_is_one_sentence_and_exit_2(capsys, words):
    with pytest.raises(SystemExit) as stop:
        main(["montecarlo", *SHORT, *words])
    said = capsys.readouterr()
    assert stop.value.code == 2 and not said.out
    assert said.err.startswith("drake-ispace: ") and said.err.count("\n") == 1


def test_interrupts_keep_whole_rows(tmp_path):
    """Killed, then stopped by Ctrl-C: only whole files are left, and they say how far it came."""
    words = [sys.executable, "-c", "from drake_ispace.cli.app import main; main()", "montecarlo", "omni_multirate",
             "--seconds", "5", "--runs", "200000", "--out", str(tmp_path)]
    for number in (signal.SIGKILL, signal.SIGINT):
        parts = len(list(tmp_path.glob("part-*")))
        process = subprocess.Popen(words, stderr=subprocess.PIPE, text=True)
        while len(list(tmp_path.glob("part-*"))) == parts and process.poll() is None:
            time.sleep(0.02)
        process.send_signal(number)
        said = process.communicate()[1]
    assert process.returncode == 130
    assert f"stopped after {read_campaign(tmp_path).num_rows} of 200000 runs" in said


def test_parity_answers_with_the_largest_difference(capsys):
    data = answer(capsys, "parity", *SHORT)
    assert data["max_abs_difference"] == 0.0 and data["ticks"] == 200


def test_both_engines_write_the_same_recording(capsys, tmp_path):
    for engine in ("drake", "compiled"):
        answer(capsys, "simulate", *SHORT, "--engine", engine, "--out", str(tmp_path / engine))
    files = {file.name: file.read_bytes() for file in (tmp_path / "drake").iterdir()}
    assert len(files) > 4
    assert files == {file.name: file.read_bytes() for file in (tmp_path / "compiled").iterdir()}


def test_an_unknown_engine_is_refused(capsys):
    with pytest.raises(SystemExit):
        main(["simulate", *SHORT, "--engine", "steam"])
    assert "compiled" in capsys.readouterr().err


def test_draw_shows_the_compiled_function(capsys):
    data = answer(capsys, "draw", "omni_multirate", "--kernel")
    assert data["kernel"].startswith("def rollout(") and data["dot"].startswith("digraph")
    assert printed(capsys, "draw", "omni_multirate", "--kernel").strip() == data["kernel"].strip()
