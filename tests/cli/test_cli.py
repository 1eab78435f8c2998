"""The command line: what it prints, what it writes, what it imports, and how it stops."""

import json
import os
import re
import shlex
import signal
import subprocess
import sys

import numpy as np
import pytest

from drake_ispace.effects.library import library
from drake_ispace.robots.recordings import load
from drake_ispace.scenario import load_scenario, scenario_names
from drake_ispace.wiring.catalog import CATALOG

METRICS = {
    "rms_position_error_m", "max_position_error_m", "rms_cross_track_m", "mean_lag_m", "rms_heading_error_rad",
    "overshoot_percent", "settling_time_s", "time_to_end_s", "iae_m_s", "control_effort", "final_error_m", "diverged",
    "diverged_at_s",
}
pytestmark = pytest.mark.usefixtures("here")
DIVERGING = ["omni_vision_feedback", "--set", "omni.control.gains=given", "--set", "omni.control.k_d=[10, 10, 40]"]
FALLING = ["pendulum_multirate", "--set", "pendulum.initial_tilt_rad=0.9", "--set", "pendulum.actuator.limit_n_m=0.3"]


@pytest.fixture
def python(launched):
    """What another Python prints, which must succeed."""

    def python(*words):
        process = launched(*words)
        out, err = process.communicate()
        assert process.returncode == 0, err
        return out

    return python


# ------------------------------------------------------------------------------------------------- what it prints


def test_list_names_diagrams_scenarios_and_effects(document):
    data = document("list")
    assert list(data) == ["diagrams", "scenarios", "effects"]
    assert data["diagrams"] == list(CATALOG) and data["scenarios"] == scenario_names()
    assert [card["name"] for card in data["effects"]] == list(library())


def test_list_has_the_whole_card_of_every_effect(document):
    cards = {card["name"]: card for card in document("list")["effects"]}
    for name, effect in library().items():
        card = cards[name]
        assert card["enters_at"] == effect.card.home and card["robots"] and card["parameters"]
        assert all(card[key] == getattr(effect.card, key) for key in ("title", "equation", "source", "signature",
                                                                     "excitation"))
        assert card["look_alikes"] == list(effect.card.look_alikes)
        for parameter in card["parameters"]:
            assert set(parameter) == {"name", "unit", "neutral", "bounds", "robots"} and len(parameter["bounds"]) == 2
    saturation = {p["name"]: p for p in cards["torque_saturation"]["parameters"]}
    assert saturation["limit_n_m"]["neutral"] is None  # no limit
    wheels = {tuple(p["robots"]): p["bounds"] for p in cards["weak_motor"]["parameters"] if p["name"] == "wheel"}
    assert wheels == {("omni",): [1, 4], ("pendulum",): [1, 2]}


def test_list_for_people_has_every_name(said):
    text = said("list")
    assert all(name in text for name in (*CATALOG, *scenario_names(), *library()))


def test_simulate_tells_where_the_robot_ends(document):
    data = document("simulate", "omni_multirate", "--seconds", "0.5")
    keys = {"diagram", "seconds", "wall_s", "realtime_factor", "diverged", "final", "recording"}
    assert keys <= set(data) and set(data["final"]) == {"x", "y", "phi"}
    assert data["diagram"] == "omni_multirate" and data["seconds"] == 0.5
    assert data["diverged"] is False and data["recording"] is None
    assert data["realtime_factor"] == pytest.approx(0.5 / data["wall_s"], rel=1e-6)


def test_simulate_for_people_says_the_same(said):
    text = said("simulate", "pendulum_multirate", "--seconds", "0.2")
    assert re.search(r"pendulum_multirate: 0\.2 s in [0-9.]+ s, [0-9.]+ times real time\n", text)
    assert re.search(r"pendulum ends at x = .* m, y = .* m, phi = .* rad\n", text)


def test_out_writes_a_recording_with_truth(document):
    data = document("simulate", "omni_multirate", "--seconds", "0.5", "--out", "new/run")
    assert data["recording"] == "new/run"
    recording = load("new/run")
    assert (recording.robot, recording.scenario) == ("omni", "omni_multirate")
    assert set(recording.channels) == {"reference", "torque", "encoder", "kinect", "truth"}
    last = recording.channels["truth"].values[-1, :3]
    assert last.tolist() == list(data["final"].values())


def test_a_recording_holds_the_scenario_that_repeats_it(document):
    variant = ["omni_multirate_as_printed", "--seconds", "0.5", "--seed", "3", "--set", "omni.plant.mass_kg=8"]
    first, again = document("simulate", *variant, "--out", "run"), document("simulate", "run/scenario.yaml")
    assert first["final"] == again["final"] and again["seconds"] == 0.5


def test_out_of_two_robots_is_two_recordings(document):
    data = document("simulate", "shared_space", "--seconds", "0.2", "--out", "both")
    assert data["recordings"] == {"omni": "both/omni", "pendulum": "both/pendulum"}
    assert {name: load(path).robot for name, path in data["recordings"].items()} == {
        "omni": "omni", "pendulum": "pendulum",
    }
    assert "imu" in load("both/pendulum").channels and set(data["finals"]) == {"omni", "pendulum"}


def test_a_recording_may_be_replaced_by_another_run(said, here):
    said("simulate", "omni_multirate", "--seconds", "0.2", "--out", "run")
    said("simulate", "pendulum_multirate", "--seconds", "0.2", "--out", "run")
    assert load("run").robot == "pendulum" and os.listdir(here) == ["run"]


def test_the_same_seed_writes_the_same_bytes_and_another_seed_others(said, here):
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        said("simulate", "pendulum_multirate", "--seconds", "0.5", "--seed", str(seed), "--out", name)
    files = {name: {file.name: file.read_bytes() for file in (here / name).glob("*.csv")} for name in "abc"}
    assert len(files["a"]) == 6 and files["a"] == files["b"]
    assert files["a"]["imu.csv"] != files["c"]["imu.csv"] and files["a"]["kinect.csv"] != files["c"]["kinect.csv"]


def test_a_later_set_wins_and_seconds_beat_them_all(document):
    sets = ["--set", "seconds=0.3", "--set", "seconds=0.2"]
    assert document("simulate", "omni_multirate", *sets)["seconds"] == 0.2
    assert document("simulate", "omni_multirate", *sets, "--seconds", "0.1")["seconds"] == 0.1


def test_schedule_has_a_row_for_every_update(document):
    rows = document("schedule", "omni_multirate")["updates"]
    assert all(set(row) == {"block", "phase", "period_ticks", "period_s", "offset_s"} for row in rows)
    periods = {row["block"]: row["period_ticks"] for row in rows}
    assert periods["omni_encoder"] == 1 and periods["kinect"] == 19 and periods["omni_way_point"] == 19


def test_schedule_for_people_is_a_table(said):
    assert re.search(r"kinect .* sense .* 95 ms .* 19 .* 0 ms", said("schedule", "omni_multirate"))


def test_compare_gives_the_metrics_of_every_run(document):
    names = ["omni_multirate", "omni_vision_feedback", "shared_space"]
    runs = document("compare", *names, "--seconds", "1.5", "--set", "omni.trajectory.start_s=0.5")["runs"]
    assert list(runs) == [*names[:2], "shared_space.omni", "shared_space.pendulum"]
    assert all(set(metrics) == METRICS for metrics in runs.values())
    assert not any(metrics["diverged"] for metrics in runs.values())


def test_compare_out_writes_a_picture_and_the_same_numbers(document, here):
    data = document("compare", "omni_multirate", "--seconds", "0.5", "--out", "new/folder")
    assert (here / "new/folder/comparison.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads((here / "new/folder/comparison.json").read_text()) == data
    assert sorted(os.listdir("new/folder")) == ["comparison.json", "comparison.png"]


def test_compare_of_scenario_files_names_them_as_given(document, here):
    (here / "a $file$.yaml").write_text("seconds: 0.2\n")
    assert list(document("compare", "./a $file$.yaml", "--out", "folder")["runs"]) == ["./a $file$.yaml"]


@pytest.mark.parametrize("arguments", [DIVERGING, FALLING], ids=["unstable", "falling"])
def test_a_lost_robot_is_reported_with_its_time(document, arguments):
    data = document("simulate", *arguments, "--seconds", "30")
    assert data["diverged"] is True and 0.0 < data["diverged_at_s"] < 30.0
    assert all(np.isfinite(list(data["final"].values())))


@pytest.mark.first_case
@pytest.mark.parametrize("arguments", [DIVERGING, FALLING], ids=["unstable", "falling"])
def test_a_lost_robot_still_has_metrics(document, arguments):
    (metrics,) = document("compare", *arguments, "--seconds", "30", "--out", "folder")["runs"].values()
    assert metrics["diverged"] is True and 0.0 < metrics["diverged_at_s"] < 30.0


def test_a_lost_robot_is_recorded_until_then(document):
    data = document("simulate", *FALLING, "--seconds", "30", "--out", "run")
    truth = load("run").channels["truth"]
    assert truth.t[-1] < data["diverged_at_s"] + 1e-5 and np.abs(truth.column("tilt")).max() <= np.pi / 2


def test_a_lost_robot_is_told_to_people(said):
    assert re.search(r"fell or was lost at [0-9.]+ s\n", said("simulate", *FALLING, "--seconds", "30"))


@pytest.mark.parametrize("suffix, start", [(".dot", b"digraph"), (".svg", b"<?xml"), (".png", b"\x89PNG")])
def test_draw_writes_a_picture(document, here, suffix, start):
    data = document("draw", "omni_multirate", "--out", f"x{suffix}")
    assert data["out"] == f"x{suffix}" and data["dot"].startswith("digraph")
    assert (here / f"x{suffix}").read_bytes().startswith(start) and os.listdir(here) == [f"x{suffix}"]


def test_draw_without_out_prints_the_dot_text(said):
    assert said("draw", "omni_multirate").startswith("digraph") and "omni_plant" in said("draw", "omni_multirate")


def test_draw_to_depth_zero_closes_the_box(said):
    assert "omni_plant" not in said("draw", "omni_multirate", "--depth", "0")


# ------------------------------------------------------------------------------------------------------ what it imports


def test_help_imports_nothing_heavy(python):
    program = (
        "import sys\nfrom drake_ispace.cli.app import main\ntry: main(['--help'])\nexcept SystemExit: pass\n"
        "heavy = ['pydrake', 'numba', 'numpy', 'scipy', 'control', 'cv2', 'matplotlib', 'pyarrow', 'joblib']\n"
        "print('heavy:', [name for name in heavy if name in sys.modules])"
    )
    shown = python("-c", program)
    assert "heavy: []" in shown and "simulate" in shown


LIGHT = [
    ["simulate", "omni_multirate", "--seconds", "0.1", "--out", "run"],
    ["compare", "omni_multirate", "omni_vision_feedback", "--seconds", "0.1", "--out", "comparison"],
    ["draw", "pendulum_multirate", "--out", "x.svg"],
]


@pytest.mark.slow
def test_everyday_commands_import_nothing_they_do_not_need(python):
    program = (
        "import sys\nfrom drake_ispace.cli.app import main\n"
        "heavy = ['pyarrow', 'jinja2', 'plotly', 'statsmodels', 'ruptures', 'joblib', 'pandas', 'cv2']\n"
        f"for words in {LIGHT}:\n"
        "    try: main(words)\n    except SystemExit: pass\n"
        "    print('heavy:', words[0], [name for name in heavy if name in sys.modules])"
    )
    said = [line for line in python("-c", program).splitlines() if line.startswith("heavy:")]
    assert said == [f"heavy: {words[0]} []" for words in LIGHT]


# ------------------------------------------------------------------------------------------------------ how it stops

TELLS_WHEN_RUNNING = """
import sys
from contextlib import contextmanager
import drake_ispace.cli.app as cli

@contextmanager
def progress(total, title, *unit):
    def advance(done):
        if not isinstance(done, str):
            print("running", flush=True)
    if title == "demo":
        print("running", flush=True)
    yield advance

assert cli.progress
cli.progress = progress
sys.argv[0] = "drake-ispace"
cli.main()
"""
LONG = {
    "compare": ["compare", "velocity_base", "odometry_replay", "--seconds", "2000", "--out", "d"],
    "simulate": ["simulate", "velocity_base", "--seconds", "2000", "--out", "d"],
    "demo": ["demo", "--out", "d"],
}


@pytest.mark.first_case
@pytest.mark.parametrize("arguments", LONG.values(), ids=LONG.keys())
def test_ctrl_c_says_so_once_and_leaves_nothing(launched, here, arguments):
    process = launched("-c", TELLS_WHEN_RUNNING, *arguments)
    assert process.stdout.readline() == "running\n"
    process.send_signal(signal.SIGINT)
    _, err = process.communicate()
    assert process.returncode == 130
    assert err == "drake-ispace: stopped, nothing half-written is left behind\n"
    assert os.listdir(here) == []


def test_names_of_files_do_not_reach_the_terminal_as_they_are(said, here):
    name = "a\x1b[31mred\u202e"
    assert r"recording: a\x1b[31mred\u202e" in said("simulate", "omni_multirate", "--seconds", "0.1", "--out", name)
    assert (here / name / "recording.yaml").is_file()


INTERRUPTED_IMPORT = """
import os, signal, sys, types
class Interrupted(types.ModuleType):
    def __getattr__(self, name):
        os.kill(os.getpid(), signal.SIGINT)
        raise AssertionError("went on")
sys.modules["drake_ispace.cli.app"] = Interrupted("drake_ispace.cli.app")
from drake_ispace.cli.start import main
main()
"""


def test_ctrl_c_while_libraries_are_imported_is_one_line(launched):
    process = launched("-c", INTERRUPTED_IMPORT)
    _, err = process.communicate()
    assert process.returncode == 130 and err == "drake-ispace: stopped, nothing half-written is left behind\n"


def test_a_closed_standard_output_is_one_sentence():
    program = f"{shlex.quote(sys.executable)} -m drake_ispace list >&-"
    done = subprocess.run(["sh", "-c", program], capture_output=True, text=True)
    assert done.returncode == 2 and done.stderr.startswith("drake-ispace: standard output: is closed, expected")


@pytest.mark.slow
def test_letters_that_the_locale_lacks_stop_nothing():
    environment = {**os.environ, "LC_ALL": "POSIX", "PYTHONIOENCODING": "ascii"}
    command = [sys.executable, "-m", "drake_ispace", "montecarlo", "omni_multirate", "--runs", "1", "--seconds", "0.1"]
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_an_ignored_ctrl_c_stays_ignored(python):
    program = "import signal, sys\nfrom drake_ispace.cli.app import main\n"
    program += "signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
    program += "try: main(['list'])\nfinally: print(signal.getsignal(signal.SIGINT) is signal.SIG_IGN)"
    assert python("-c", program).endswith("\nTrue\n")


@pytest.mark.slow
@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
def test_a_full_disk_behind_standard_output_is_one_sentence(launched):
    with open("/dev/full", "w") as full:
        process = launched("-m", "drake_ispace", "list", stdout=full)
        _, err = process.communicate()
    assert process.returncode == 2 and err.startswith("drake-ispace: standard output: cannot be written")
    assert err.count("\n") == 1


def test_a_reader_that_leaves_early_is_no_error(launched):
    process = launched("-m", "drake_ispace", "list")
    process.stdout.close()
    assert process.stderr.read() == "" and process.wait() in (0, 1)


# -------------------------------------------------------------------------------------------------------- from Python


def test_a_run_in_three_lines_of_python():
    from drake_ispace.simulation import simulate

    run = simulate(load_scenario("omni_multirate", ["seconds=0.5", "omni.plant.slip.ratio=[0.1, 0.1, 0.1]"]))
    assert run.signals["omni_pose"].shape == (101, 3) and run.diverged_s is None


@pytest.mark.slow
def test_python_m_is_the_same_command(python):
    assert json.loads(python("-m", "drake_ispace", "list", "--json"))["diagrams"] == list(CATALOG)
