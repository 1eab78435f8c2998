"""Bad input to the command line: one sentence that says where and what was expected, exit code 2, nothing written."""

import pytest

import drake_ispace.comparison
import drake_ispace.explain.explain
import drake_ispace.hiding
import drake_ispace.report.demo
import drake_ispace.report.pictures.drawing
import drake_ispace.report.pictures.schedule
import drake_ispace.rollout.compile
import drake_ispace.simulation

SHORT = ["--seconds", "0.1"]
OMNI = ["simulate", "omni_multirate", *SHORT]
FILE = ["simulate", "./scenario.yaml", *SHORT]
POLYLINE = ["omni.trajectory.kind=polyline"]
CSV = [*OMNI, "--set", "omni.trajectory.kind=polyline", "--set", "omni.trajectory.csv=path.csv"]
HEAVY = {drake_ispace.simulation: "make_simulator", drake_ispace.rollout.compile: "machine_code"}
OUTSIDE = ["outside of the 2.5 x 2 m space", "expected |x| <= 1.25 and |y| <= 1", "omni.trajectory"]


def sets(*overrides, command=OMNI):
    return [*command, *[word for override in overrides for word in ("--set", override)]]


@pytest.fixture
def refused(refused):
    """As that of all tests, and before anything is simulated or compiled."""

    def early(*words):
        with pytest.MonkeyPatch.context() as patch:
            for module, heavy in HEAVY.items():
                patch.setattr(module, heavy, lambda *arguments, heavy=heavy: pytest.fail(f"{heavy} was called"))
            return refused(*words)

    return early


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """The current folder, with things that are in the way."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("keep")
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "thesis.tex").write_text("keep")
    return tmp_path


def contents(folder):
    return {str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


# What is wrong on the command line -> arguments, and parts of the sentence.
ARGUMENTS = {
    "unit": (
        sets("omni.plant.mass_kg=8 kg"),
        ["--set", "omni.plant.mass_kg", "number without a unit, in kg", "'8 kg'"],
    ),
    "word_for_number": (sets("omni.plant.mass_kg=heavy"), ["omni.plant.mass_kg", "expected a number", "'heavy'"]),
    "nothing_for_number": (sets("omni.plant.mass_kg="), ["omni.plant.mass_kg", "expected a number [kg]"]),
    "list_too_short": (sets("omni.control.q=[1, 2]"), ["omni.control.q", "expected a list of 6 values", "[1, 2]"]),
    "list_too_long": (sets("omni.control.r=[1, 2, 3, 4]"), ["omni.control.r", "expected a list of 3 values"]),
    "number_for_list": (sets("omni.control.q=3"), ["omni.control.q", "expected a list of 6 values", "got 3"]),
    "number_for_section": (sets("omni.plant=3"), ["omni.plant", "expected a mapping with keys such as mass_kg", "3"]),
    "negative_mass": (sets("omni.plant.mass_kg=-1"), ["omni.plant.mass_kg", "expected more than 0 [kg]", "-1"]),
    "zero_radius": (sets("omni.plant.wheel_radius_m=0"), ["omni.plant.wheel_radius_m", "more than 0 [m]", "got 0"]),
    "one_of_a_list": (sets("omni.control.r=[1, 0, 1]"), ["omni.control.r[1]", "expected more than 0", "got 0"]),
    "nan": (sets("omni.plant.mass_kg=.nan"), ["--set omni.plant.mass_kg", "'.nan'", "expected a finite number"]),
    "inf": (sets("omni.plant.mass_kg=inf"), ["--set omni.plant.mass_kg", "'inf'", "expected a finite number"]),
    "beyond_doubles": (sets("omni.plant.mass_kg=1e400"), ["omni.plant.mass_kg", "'1e400'", "out of range"]),
    "huge": (sets("omni.plant.mass_kg=1e300"), ["omni.plant.mass_kg", "between 1e-12 and 1e+09 [kg]", "1e+300"]),
    "tiny": (sets("omni.plant.mass_kg=1e-300"), ["omni.plant.mass_kg", "between 1e-12 and 1e+09 [kg]", "1e-300"]),
    "yes_is_a_word": (
        sets("omni.control.velocity_feed_forward=yes"),
        ["velocity_feed_forward", "true or false", "'yes'"],
    ),
    "one_is_not_true": (sets("omni.control.velocity_feed_forward=1"), ["velocity_feed_forward", "true or false", "1"]),
    "true_is_not_one": (sets("omni.plant.mass_kg=true"), ["omni.plant.mass_kg", "expected a number", "True"]),
    "sexagesimal": (sets("seconds=1:30"), ["seconds", "number without a unit, in s", "'1:30'"]),
    "octal_with_underscore": (sets("seed=1_000"), ["seed", "expected a whole number", "'1_000'"]),
    "half_a_seed": (sets("seed=1.5"), ["seed", "expected a whole number", "1.5"]),
    "number_for_a_word": (sets("omni.trajectory.kind=8"), ["omni.trajectory.kind", "expected a word", "8"]),
    "unknown_choice": (sets("omni.trajectory.kind=spiral"), ["omni.trajectory.kind", "'spiral'", "figure_eight"]),
    "too_tilted": (sets("pendulum.initial_tilt_rad=2"), ["pendulum.initial_tilt_rad", "at most 1 [rad]", "2"]),
    "dropout": (sets("space.localizer.dropout=1.5"), ["space.localizer.dropout", "at most 1", "1.5"]),
    "marker_spacing": (sets("space.localizer.marker_spacing_m=0"), ["marker_spacing_m", "more than 0 [m]", "0"]),
    "traction_gain_one": (sets("omni.plant.slip.traction_gain=[1, 0, 0]"), ["traction_gain[0]", "less than 1", "1"]),
    "traction_gain_negative": (
        sets("omni.plant.slip.traction_gain=[0, -1, 0]"),
        ["traction_gain[1]", "at least 0", "-1"],
    ),
    "patch_reversed": (sets("omni.plant.slip.patch_m=[1, -1, 0, 1]"), ["omni.plant.slip.patch_m", "x_min < x_max"]),
    "friction_too_steep": (
        sets("omni.plant.friction.coulomb_n_m=0.01", "omni.plant.friction.speed_scale_rad_s=1e-3"),
        ["omni_multirate", "omni.plant.friction.speed_scale_rad_s", "5 ms", "expected at least"],
    ),
    "no_feedback_possible": (sets("omni.control.q=[1e9, 0, 0, 0, 0, 0]"), ["omni_multirate", "expected", "defaults"]),
    "wheels_in_one_place": (sets("omni.plant.wheel_distance_m=1e-12"), ["omni_multirate", "wheels", "expected"]),
    "unknown_key": (
        sets("omni.plant.mas_kg=3"),
        ["--set", "omni.plant.mas_kg", "unknown key", "did you mean 'mass_kg'?"],
    ),
    "unlike_any_key": (sets("omni.plant.zzz=3"), ["omni.plant.zzz", "unknown key", "expected one of mass_kg"]),
    "unknown_section": (sets("omnni.plant.mass_kg=3"), ["omnni", "unknown key", "did you mean 'omni'?"]),
    "set_without_value": (sets("omni.plant.mass_kg"), ["--set 'omni.plant.mass_kg'", "expected key=value"]),
    "set_without_key": (sets("=3"), ["--set '=3'", "expected key=value"]),
    "set_nothing": (sets(""), ["--set ''", "expected key=value"]),
    "set_empty_part": (sets("omni..mass_kg=3"), ["omni.", "unknown key"]),
    "set_two_lines": (sets("omni.plant.mass_kg=8\nseed: 3"), ["--set", "expected key=value"]),
    "set_open_bracket": (sets("omni.control.q=[1"), ["--set omni.control.q", "valid YAML"]),
    "set_very_deep": (sets("omni" + ".a" * 100_000 + "=1"), ["--set", "expected key=value"]),
    "set_anchor": (sets("omni.plant.mass_kg=&a 3"), ["--set omni.plant.mass_kg", "anchor"]),
    "set_without_argument": ([*OMNI, "--set"], ["--set"]),
    "seconds_zero": (
        ["simulate", "omni_multirate", "--seconds", "0"],
        ["--seconds", "expected at least 0.005 [s]", "0"],
    ),
    "seconds_negative": (["simulate", "omni_multirate", "--seconds", "-1"], ["--seconds", "at least 0.005 [s]", "-1"]),
    "seconds_nan": (["simulate", "omni_multirate", "--seconds", "nan"], ["--seconds", "finite number [s]", "nan"]),
    "seconds_inf": (["simulate", "omni_multirate", "--seconds", "inf"], ["--seconds", "finite number [s]", "inf"]),
    "seconds_text": (["simulate", "omni_multirate", "--seconds", "ten"], ["--seconds", '"ten"', "float"]),
    "seconds_huge": (["simulate", "omni_multirate", "--seconds", "1e300"], ["--seconds", "at most 41943 [s]"]),
    "seed_negative": ([*OMNI, "--seed", "-1"], ["--seed", "expected at least 0", "-1"]),
    "seed_text": ([*OMNI, "--seed", "lucky"], ["--seed", "expected a whole number", "'lucky'"]),
    "seed_and_a_half": ([*OMNI, "--seed", "1.5"], ["--seed", "expected a whole number", "'1.5'"]),
    "unknown_scenario": (["simulate", "omni_multirat"], ["'omni_multirat'", "did you mean 'omni_multirate'?"]),
    "unlike_any_scenario": (["schedule", "zzz"], ["no scenario 'zzz'", "expected one of", "shared_space"]),
    "no_file": (["simulate", "./nope.yaml"], ["./nope.yaml", "expected a file"]),
    "file_is_a_folder": (["simulate", "./folder"], ["./folder", "expected a file"]),
    "unknown_command": (["simulat", "omni_multirate"], ['"simulat"', '"simulate"']),
    "unknown_option": ([*OMNI, "--second", "3"], ["--second", "--seconds"]),
    "no_name": (["simulate"], ["simulate", "NAME"]),
    "two_names": ([*OMNI, "pendulum_multirate"], ["'pendulum_multirate'", "expected"]),
    "compare_nothing": (["compare"], ["compare", "expected"]),
    "compare_twice": (
        ["compare", "omni_multirate", "omni_multirate", *SHORT],
        ["'omni_multirate'", "twice", "different"],
    ),
    "compare_second_unknown": (["compare", "omni_multirate", "omni_multirat"], ["'omni_multirat'", "did you mean"]),
    "depth_negative": (["draw", "omni_multirate", "--depth", "-1"], ["--depth", "expected 0", "-1"]),
    "depth_huge": (["draw", "omni_multirate", "--depth", "9" * 30], ["--depth", "expected 0"]),
    "depth_text": (["draw", "omni_multirate", "--depth", "deep"], ["--depth", "expected a whole number", "'deep'"]),
    "picture_pdf": (["draw", "omni_multirate", "--out", "x.pdf"], ["x.pdf", ".dot, .svg or .png", "'.pdf'"]),
    "picture_without_suffix": (["draw", "omni_multirate", "--out", "x"], ["x", ".dot, .svg or .png"]),
    "picture_below_a_file": (["draw", "omni_multirate", "--out", "file/x.dot"], ["file", "cannot be written"]),
    "out_below_a_file": ([*OMNI, "--out", "file/run"], ["file/run", "cannot be written", "expected a folder"]),
    "out_in_proc": ([*OMNI, "--out", "/proc/run"], ["/proc/run", "cannot be written", "expected a folder"]),
    "out_is_a_file": ([*OMNI, "--out", "file"], ["file", "not a recording", "expected a new folder"]),
    "out_is_another_folder": ([*OMNI, "--out", "folder"], ["folder", "not a recording", "expected a new folder"]),
    "out_is_nothing": ([*OMNI, "--out", ""], ["not a recording", "expected a new folder"]),
    "out_name_too_long": ([*OMNI, "--out", "x" * 240], ["cannot be written", "expected a folder"]),
    "comparison_in_a_file": (["compare", "omni_multirate", *SHORT, "--out", "file"], ["file", "cannot be written"]),
    "comparison_in_proc": (["compare", "omni_multirate", *SHORT, "--out", "/proc/x"], ["/proc/x", "cannot be written"]),
    "demo_in_a_file": (["demo", *SHORT, "--out", "file"], ["file", "cannot be written", "expected a folder"]),
    "demo_in_another_folder": (["demo", *SHORT, "--out", "folder"], ["folder", "something else", "expected a new"]),
    "demo_seconds_zero": (["demo", "--seconds", "0", "--out", "d"], ["--seconds", "expected at least 0.005 [s]"]),
    "demo_seed_negative": (["demo", "--seed", "-1", "--out", "d"], ["--seed", "expected at least 0"]),
    "explain_nothing": (["explain", "--model", "omni_multirate"], ["explain", "folder of at least one run"]),
    "explain_without_a_model": (["explain", "folder"], ["--model"]),
    "explain_no_run": (["explain", "nowhere", "--model", "omni_multirate"], ["nowhere", "expected the folder of"]),
    "explain_another_folder": (["explain", "folder", "--model", "omni_multirate"], ["folder/recording.yaml", "file"]),
    "explain_a_held_out_run": (
        ["explain", "folder", "--model", "omni_multirate", "--held-out", "./folder"],
        ["--held-out folder: is named twice"],
    ),
    "explain_out": (
        ["explain", "nowhere", "--model", "omni_multirate", "--out", "folder"], ["folder", "something else"],
    ),
    "hide_nowhere": (["hide", "omni_multirate"], ["--out"]),
    "escapes_in_a_name": (["simulate", "a\x1b[31mred"], [r"a\x1b[31mred"]),
    "hide_in_another_folder": (["hide", "omni_multirate", "--out", "folder"], ["folder", "expected a new or an empty"]),
    "hide_an_unknown_effect": (
        ["hide", "omni_multirate", "--effect", "coulomb_frictoin:torque_n_m=1", "--out", "h"],
        ["effects.coulomb_frictoin", "did you mean 'coulomb_friction'?"],
    ),
    "hide_an_unknown_parameter": (
        ["hide", "omni_multirate", "--effect", "coulomb_friction:torque=1", "--out", "h"],
        ["effects.coulomb_friction.torque", "unknown parameter", "did you mean 'torque_n_m'?"],
    ),
    "hide_too_much": (
        ["hide", "omni_multirate", "--effect", "weak_motor:loss=2", "--out", "h"], ["weak_motor.loss", "at most"],
    ),
    "hide_a_word": (
        ["hide", "omni_multirate", "--effect", "weak_motor:loss=much", "--out", "h"], ["weak_motor.loss", "a number"],
    ),
    "hide_nan": (
        ["hide", "omni_multirate", "--effect", "weak_motor:loss=nan", "--out", "h"], ["weak_motor:loss", "finite"],
    ),
    "hide_without_parameters": (
        ["hide", "omni_multirate", "--effect", "weak_motor", "--out", "h"],
        ["--effect 'weak_motor'", "expected name:parameter=value"],
    ),
    "hide_half_a_wheel": (
        ["hide", "omni_multirate", "--effect", "weak_motor:wheel=1.5,loss=0.1", "--out", "h"],
        ["weak_motor.wheel", "whole number"],
    ),
    "hide_in_another_robot": (
        ["hide", "omni_multirate", "--robot", "pendulum", "--out", "h"], ["--robot", "'pendulum'", "omni"],
    ),
    "hide_no_run": (["hide", "omni_multirate", "--runs", "0", "--out", "h"], ["--runs", "expected 1 to 1000", "0"]),
    "hide_seed": (["hide", "omni_multirate", "--seed", "-1", "--out", "h"], ["--seed", "at least 0", "-1"]),
    "hide_seconds": (["hide", "omni_multirate", "--seconds", "0", "--out", "h"], ["--seconds", "at least 0.005"]),
    "start_outside": (sets("omni.initial_pose=[9, 0, 0]"), ["omni.initial_pose", "(9, 0) m", *OUTSIDE[:2]]),
    "points_missing": (sets(*POLYLINE), ["omni.trajectory.points_m", "expected 2 to 10000 points", "got 0"]),
    "one_point": (sets(*POLYLINE, "omni.trajectory.points_m=[[0, 0]]"), ["points_m", "2 to 10000 points", "got 1"]),
    "repeated_point": (
        sets(*POLYLINE, "omni.trajectory.points_m=[[0, 0], [1, 0], [1, 0]]"),
        ["points_m[2]", "repeats", "another place"],
    ),
    "point_of_one": (sets(*POLYLINE, "omni.trajectory.points_m=[[0, 0], [1]]"), ["points_m[1]", "[x, y]", "[1.0]"]),
    "point_of_three": (sets(*POLYLINE, "omni.trajectory.points_m=[[0, 0, 0], [1, 1, 1]]"), ["points_m[0]", "[x, y]"]),
    "points_flat": (sets(*POLYLINE, "omni.trajectory.points_m=[0, 1]"), ["points_m[0]", "expected a list", "got 0"]),
    "point_of_words": (sets(*POLYLINE, "omni.trajectory.points_m=[[a, 1]]"), ["points_m[0][0]", "a number", "'a'"]),
    "line_to_its_start": (
        sets("omni.trajectory.kind=line", "omni.trajectory.goal_m=[0, 0]"),
        ["goal_m", "another place"],
    ),
    "csv_missing": (CSV, ["omni_multirate", "omni.trajectory.csv", "'path.csv'", "not there", "header x,y"]),
    "csv_is_a_folder": (sets(*POLYLINE, "omni.trajectory.csv=folder"), ["omni.trajectory.csv", "'folder'", "no file"]),
    "csv_is_a_device": (
        sets(*POLYLINE, "omni.trajectory.csv=/dev/zero"),
        ["omni.trajectory.csv", "'/dev/zero'", "no file"],
    ),
    "csv_with_nul_in_its_name": (sets(*POLYLINE, 'omni.trajectory.csv="a\\0b"'), ["omni.trajectory.csv", "not there"]),
    "csv_for_a_square": (sets("omni.trajectory.csv=path.csv"), ["omni.trajectory.csv", "expected kind polyline"]),
}  # fmt: skip


@pytest.mark.parametrize("arguments, parts", ARGUMENTS.values(), ids=ARGUMENTS.keys())
def test_bad_arguments_are_refused(folder, refused, arguments, parts):
    before = contents(folder)
    message = refused(*arguments)
    for part in parts:
        assert part in message
    assert contents(folder) == before


KINDS = ("step", "pulse", "line", "square", "circle", "figure_eight", "polyline")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("robot", ["omni", "pendulum"])
def test_a_way_point_outside_of_the_space_is_refused(refused, robot, kind):
    away = ("centre_m=[1.0, 0.0]", "goal_m=[1.3, 0.0]", "points_m=[[0, 0], [1.3, 0]]", f"kind={kind}")
    command = ["simulate", f"{robot}_multirate", *SHORT]
    message = refused(*sets(*[f"{robot}.trajectory.{part}" for part in away], command=command))
    assert f"{robot}.trajectory: way point" in message and OUTSIDE[0] in message and OUTSIDE[1] in message


BOMB = "a: &a [x, x]\nb: &b [*a, *a, *a, *a, *a, *a, *a, *a, *a]\nc: [*b, *b, *b, *b, *b, *b, *b, *b, *b]\n"

# What the scenario file holds -> parts of the sentence, besides the name of the file.
SCENARIOS = {
    "empty": ("", ["empty"]),
    "comment": ("# nothing\n", ["empty"]),
    "list": ("- omni_multirate\n", ["line 1", "top level"]),
    "word": ("omni_multirate\n", ["line 1", "top level"]),
    "broken": ("omni: [1, 2\nseed: 1\n", ["line 2", "valid YAML"]),
    "tab": ("omni:\n\tplant: {}\n", ["line 2", "valid YAML"]),
    "binary": (bytes(range(256)), ["UTF-8", "0x80"]),
    "utf16": ("diagram: omni_multirate\n".encode("utf-16"), ["line 1", "UTF-8"]),
    "nul": ("diagram: omni\0\n", ["valid YAML"]),
    "two_documents": ("seed: 1\n---\nseed: 2\n", ["second YAML document"]),
    "unknown_key": ("digram: omni_multirate\n", ["digram", "unknown key", "did you mean 'diagram'?"]),
    "unknown_inner_key": ("omni: {plant: {mas_kg: 3}}\n", ["omni.plant.mas_kg", "did you mean 'mass_kg'?"]),
    "duplicate_key": ("seed: 1\nseed: 2\n", ["line 2", "seed", "twice"]),
    "duplicate_inner_key": ("omni:\n  plant: {}\n  plant: {}\n", ["line 3", "omni.plant", "twice"]),
    "unknown_diagram": ("diagram: omni_multirat\n", ["no Diagram 'omni_multirat'", "did you mean 'omni_multirate'?"]),
    "diagram_is_a_number": ("diagram: 5\n", ["diagram", "expected a word", "got 5"]),
    "section_is_a_list": ("omni: []\nseed: 1\n", ["omni", "expected a mapping"]),
    "unit": ("omni: {plant: {mass_kg: 8 kg}}\n", ["omni.plant.mass_kg", "without a unit, in kg", "'8 kg'"]),
    "nan": ("omni: {plant: {mass_kg: .NaN}}\n", ["line 1", "omni.plant.mass_kg", "finite"]),
    "anchors": (BOMB, ["line 1", "anchor"]),
    "merge": ("<<: {seed: 1}\n", ["line 1", "plain word"]),
    "tag": ("seed: !!python/object/apply:os.system [ls]\n", ["line 1", "seed", "tag"]),
    "deep": ("omni: " + "[" * 100_000, ["nested more than 32 deep"]),
    "large": ("# " + "x" * 1_000_000, ["larger than 262144 bytes"]),
    "start_outside": ("pendulum: {initial_pose: [0, 3, 0]}\n", ["pendulum.initial_pose", "(0, 3) m", "|y| <= 1"]),
    "path_outside": ("omni: {trajectory: {side_m: 2.2}}\n", ["omni.trajectory", "way point", "2.5 x 2 m space"]),
}  # fmt: skip


@pytest.mark.parametrize("text, parts", SCENARIOS.values(), ids=SCENARIOS.keys())
def test_a_bad_scenario_file_is_refused(folder, refused, text, parts):
    (folder / "scenario.yaml").write_bytes(text if isinstance(text, bytes) else text.encode())
    message = refused(*FILE)
    assert message.startswith("drake-ispace: ./scenario.yaml: ")
    for part in parts:
        assert part in message


# What the CSV file of a polyline holds -> parts of the sentence, besides key and name of the file.
TABLES = {
    "empty": ("", ["line 1", "expected the header x,y"]),
    "no_header": ("0,0\n1,1\n", ["line 1", "header x,y", "'0,0'"]),
    "other_header": ("y,x\n0,0\n1,1\n", ["line 1", "header x,y", "'y,x'"]),
    "header_only": ("x,y\n", ["2 to 10000 points", "got 0"]),
    "one_row": ("x,y\n0,0\n", ["2 to 10000 points", "got 1"]),
    "unit_row": ("x,y\nm,m\n0,0\n1,0\n", ["line 2", "two numbers x,y", "'m,m'"]),
    "decimal_commas": ("x,y\n0,5,0,5\n", ["line 2", "decimal points", "'0,5,0,5'"]),
    "semicolons": ("x;y\n0;0\n1;1\n", ["line 1", "header x,y", "'x;y'"]),
    "semicolons_below": ("x,y\n0;0\n", ["line 2", "two numbers x,y", "'0;0'"]),
    "utf16": ("x,y\n0,0\n1,0\n".encode("utf-16"), ["not UTF-8", "header x,y"]),
    "utf16_without_mark": ("x,y\n0,0\n1,0\n".encode("utf-16-le"), ["NUL bytes", "header x,y"]),
    "nul": ("x,y\n0,\0\n", ["NUL bytes"]),
    "ragged": ("x,y\n0,0\n1\n", ["line 3", "two numbers x,y", "'1'"]),
    "third_column": ("x,y\n0,0,0\n", ["line 2", "two numbers x,y", "'0,0,0'"]),
    "nan": ("x,y\n0,0\nnan,1\n", ["line 3", "finite", "'nan,1'"]),
    "inf": ("x,y\n0,-inf\n", ["line 2", "finite", "'0,-inf'"]),
    "huge": ("x,y\n0,0\n1e300,0\n", ["line 3", "finite", "'1e300,0'"]),
    "underscore": ("x,y\n0,0\n1_0,0\n", ["line 3", "two numbers x,y", "'1_0,0'"]),
    "empty_cell": ("x,y\n0,\n", ["line 2", "two numbers x,y"]),
    "long_cell": ("x,y\n0," + "1" * 200_000, ["line 2", "finite"]),
    "repeated_point": ("x,y\n0,0\n\n0,0\n", ["line 4", "repeats", "another place"]),
    "too_large": ("x,y\n" + "0,0\n1,1\n" * 200_000, ["larger than", "header x,y"]),
}  # fmt: skip


@pytest.mark.parametrize("text, parts", TABLES.values(), ids=TABLES.keys())
def test_a_bad_table_of_points_is_refused(folder, refused, text, parts):
    (folder / "path.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    message = refused(*CSV)
    assert message.startswith("drake-ispace: omni_multirate: omni.trajectory.csv: 'path.csv'")
    for part in parts:
        assert part in message


def test_nothing_is_simulated_before_every_name_is_checked(folder, refused, monkeypatch):
    (folder / "scenario.yaml").write_text("diagram: omni_vision_feedback\nomni: {plant: {wheel_distance_m: 1e-12}}\n")
    monkeypatch.setattr(drake_ispace.comparison, "simulate_diagram", pytest.fail)
    assert refused("compare", "omni_multirate", "./scenario.yaml", *SHORT).startswith(
        "drake-ispace: ./scenario.yaml: "
    )


def test_two_robots_are_not_recorded_into_the_recording_of_one(folder, said, refused):
    said(*OMNI, "--out", "run")
    message = refused("simulate", "shared_space", *SHORT, "--out", "run")
    assert "run: is a recording, expected a folder for those of omni and pendulum" in message


def test_a_recording_with_something_else_in_it_is_not_replaced(folder, said, refused):
    said(*OMNI, "--out", "run")
    (folder / "run" / "notes.txt").write_text("keep")
    before = contents(folder)
    assert "notes.txt" in refused(*OMNI, "--out", "run")
    assert contents(folder) == before


def test_a_scenario_without_a_diagram_is_the_default_one(folder, said):
    (folder / "scenario.yaml").write_text("seed: 3\n")
    assert said(*FILE).startswith("omni_multirate: 0.1 s")
