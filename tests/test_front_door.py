"""`import drake_ispace as di`: light to import, complete, and the same whatever was imported before."""

import ast
import itertools
import subprocess
import sys
from pathlib import Path

import pytest

import drake_ispace as di
from drake_ispace.blocks.errors import InputError
from drake_ispace.scenario import Scenario, load_scenario

HEAVY = ("numpy", "pydrake", "numba", "scipy", "cv2", "matplotlib", "pyarrow")
NAMES = {
    "build_diagram", "check", "compare", "compile_diagram", "draw", "effects", "explain", "hide", "load",
    "load_scenario",
    "montecarlo", "simulate",
}
SHORT = ["seconds=0.2"]


def python(code):
    """What a fresh interpreter prints."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_importing_it_loads_nothing_heavy():
    assert python(f"import sys, drake_ispace; print([name for name in {HEAVY} if name in sys.modules])") == "[]"


def test_it_gives_these_names_and_no_others():
    assert set(di.__all__) == set(dir(di)) == NAMES


@pytest.mark.parametrize("name", sorted(NAMES))
def test_every_name_is_a_function_with_a_docstring(name):
    assert callable(getattr(di, name)) and getattr(di, name).__doc__


def test_type_checkers_see_the_same_objects():
    tree = ast.parse(Path(di.__file__).read_text(encoding="utf-8"))
    (block,) = (node for node in tree.body if isinstance(node, ast.If))
    seen = {
        alias.asname or alias.name: f"{imported.module}:{alias.name}"
        for imported in block.body for alias in imported.names
    }
    assert seen == {name: f"drake_ispace.{place}" for name, place in di._BEHIND.items()}


def test_a_wrong_name_is_answered_with_the_right_one():
    with pytest.raises(AttributeError, match=r"no attribute 'simulat', did you mean 'simulate'\?"):
        di.simulat  # noqa: B018


ORDERS = list(itertools.permutations((
    "from drake_ispace.effects.card import Card",
    "import drake_ispace.effects.library",
    "drake_ispace.effects()",
)))


@pytest.fixture(scope="module")
def found():
    """Whether the function is there after each of ORDERS, in an interpreter that forgets door and folder before each.

    What else it imported stays: to import all of it takes a second.
    """
    own = "m == 'drake_ispace' or m.startswith('drake_ispace.effects')"
    forget = f"for name in [m for m in sys.modules if {own}]: del sys.modules[name]"
    said = "print('clock_offset' in drake_ispace.effects())"
    return python("\n".join(["import sys", *("\n".join([forget, "import drake_ispace", *o, said]) for o in ORDERS)]))


@pytest.mark.parametrize("number", range(len(ORDERS)))
def test_the_folder_of_effects_does_not_hide_the_function(found, number):
    assert found.splitlines()[number] == "True"


def test_a_submodule_imported_before_the_package_is_named_does_not_either():
    assert python("import drake_ispace.effects as e, drake_ispace; print(e is drake_ispace.effects, len(e()) > 9)") == (
        "True True"
    )


def test_folders_that_have_a_name_of_the_door_are_these():
    folder = Path(di.__file__).parent
    assert NAMES & {path.stem for path in folder.iterdir()} == {"effects", "explain"}


def test_simulate_takes_a_name_a_file_and_a_scenario(tmp_path):
    file = tmp_path / "short.yaml"
    file.write_text("diagram: omni_multirate\nseconds: 0.2\n", encoding="utf-8")
    runs = [di.simulate(given) for given in (load_scenario("omni_multirate", SHORT), file, str(file))]
    assert len({tuple(run.signals["omni_pose"][-1]) for run in runs}) == 1
    assert isinstance(runs[1].scenario, Scenario)


def test_compare_takes_a_list_or_names_of_ones_own():
    listed = di.compare([load_scenario("omni_multirate", SHORT), "omni_vision_feedback"])
    named = di.compare({"mine": load_scenario("omni_multirate", SHORT), "room": "omni_vision_feedback"})
    assert list(listed) == ["omni_multirate", "omni_vision_feedback"] and list(named) == ["mine", "room"]
    assert listed["omni_multirate"][2] == named["mine"][2]


@pytest.mark.parametrize("given", [[], ["omni_multirate", "omni_multirate"], ["omni_multirat"], [7]])
def test_compare_refuses(given):
    with pytest.raises(InputError, match=r"no scenario|named twice|got 7"):
        di.compare(given)


def test_draw_takes_a_name_or_a_diagram(tmp_path):
    di.draw("omni_multirate", tmp_path / "a.dot")
    di.draw(di.build_diagram("omni_multirate"), str(tmp_path / "b.dot"))
    assert (tmp_path / "a.dot").read_text() == (tmp_path / "b.dot").read_text()


def test_montecarlo_takes_a_scenario():
    found = di.montecarlo(load_scenario("omni_multirate", SHORT), 2)
    assert found.table["scenario"].to_pylist() == ["omni_multirate"] * 2


def test_explain_takes_a_name_and_a_folder(tmp_path):
    tilt = {"floor_tilt": {"slope_x_rad": 0.03, "slope_y_rad": -0.02}}
    di.hide("omni_multirate", "omni", tilt, ["circle"], seconds=5.0)["circle"].save(tmp_path / "run")
    assert di.load(tmp_path / "run").robot == "omni"
    few = [di.effects()[name] for name in ("floor_tilt", "coulomb_friction", "mass_error")]
    found = di.explain("omni_multirate", tmp_path / "run", effects=few)
    assert [effect.name for effect in found.effects] == ["floor_tilt"]
    assert found.proof == "" and {row.runs for row in found.gap} == {"training"}  # too short to be cut into blocks
