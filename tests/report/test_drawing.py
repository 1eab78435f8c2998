"""Pictures: readable text, the same bytes for the same Diagram, and one sentence where none can be drawn."""

import re
import subprocess
import sys

import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Adder, Gain, ZeroOrderHold

from drake_ispace.blocks.errors import InputError
from drake_ispace.report.pictures import drawing
from drake_ispace.report.pictures.drawing import COLOURS, dot_text, draw
from drake_ispace.scenario import load_scenario
from drake_ispace.wiring.catalog import CATALOG, build_diagram


def picture_of(name, **options):
    return dot_text(build_diagram(load_scenario(name)), **options)


def users_own(name="a<b>&\"c'"):
    """A user's Diagram: a nested one, names that HTML and Graphviz would misread, and blocks without a name."""
    inner = DiagramBuilder()
    gain = inner.AddSystem(Gain(2.0, 1))
    gain.set_name(name)
    hold = inner.AddSystem(ZeroOrderHold(0.1, 1))
    inner.Connect(gain.get_output_port(), hold.get_input_port())
    inner.ExportInput(gain.get_input_port(), "in<x>")
    inner.ExportOutput(hold.get_output_port(), "out")
    outer = DiagramBuilder()
    room = outer.AddSystem(inner.Build())
    room.set_name("s12")
    adder = outer.AddSystem(Adder(1, 1))
    outer.Connect(room.get_output_port(), adder.get_input_port(0))
    outer.ExportInput(room.get_input_port(), "u")
    outer.ExportOutput(adder.get_output_port(), "y")
    return outer.Build()


def refusal(*arguments):
    with pytest.raises(InputError) as caught:
        draw(*arguments)
    return str(caught.value)


@pytest.mark.parametrize("name", CATALOG)
def test_every_block_has_its_name_as_title(name):
    diagram = build_diagram(load_scenario(name))
    text = dot_text(diagram)
    assert all(f"<B>{block.get_name()}</B>" in text for block in diagram.GetSystems())


@pytest.mark.parametrize("name", CATALOG)
def test_every_wire_is_drawn(name):
    diagram = build_diagram(load_scenario(name))
    assert dot_text(diagram).count(" -> ") == len(diagram.connection_map())


def test_class_and_period_stand_below_the_name():
    assert re.search(r"<B>kinect</B>.*KinectLocalizer, every 95 ms<", picture_of("omni_multirate"))


def test_the_outputs_for_logging_are_left_away():
    assert "omni_estimate" not in picture_of("omni_multirate").replace("omni_estimator", "")


def test_no_module_path_and_no_address():
    assert not re.search(r"drake_ispace\.|@|0x", picture_of("shared_space") + dot_text(users_own()))


def test_the_torque_closes_the_loop_from_right_to_left():
    assert '"omni_actuator":u0 -> "omni_compensator":y0 [dir=back' in picture_of("omni_multirate")


def test_the_room_is_framed_with_its_multiplexers():
    (room,) = re.findall(r"subgraph cluster_room \{.*?\}", picture_of("shared_space"), re.S)
    members = set(re.findall(r'^"(\w+)"$', room, re.M))
    assert members == {
        "kinect", "poses", "fixes", "omni_way_point", "omni_link", "pendulum_way_point", "pendulum_tracker",
        "pendulum_link",
    }


def test_the_same_text_for_two_builds():
    assert picture_of("shared_space") == picture_of("shared_space")


@pytest.mark.parametrize("suffix", [".svg", ".png"])
def test_the_same_bytes_for_two_builds(tmp_path, suffix):
    for stem in ("first", "second"):
        draw(build_diagram(load_scenario("omni_multirate")), tmp_path / f"{stem}{suffix}")
    assert (tmp_path / f"first{suffix}").read_bytes() == (tmp_path / f"second{suffix}").read_bytes()


def test_an_svg_does_not_name_its_graphviz(tmp_path):
    draw(users_own(), tmp_path / "own.svg")
    assert "enerated by" not in (tmp_path / "own.svg").read_text()


def test_a_highlighted_block_stands_out():
    signal = COLOURS["new"][0]
    title = re.search(rf'BGCOLOR="{signal}"[^\n]*\n<B>(\w+)</B>', picture_of("omni_multirate", highlight={"omni_link"}))
    assert title[1] == "omni_link"


def test_nothing_is_highlighted_unasked():
    assert COLOURS["new"][0] not in picture_of("omni_multirate")


def test_depth_0_is_one_box():
    assert " -> " not in picture_of("omni_multirate", depth=0)


def test_depth_1_leaves_nested_diagrams_closed():
    assert "ZeroOrderHold" in dot_text(users_own()) and "ZeroOrderHold" not in dot_text(users_own(), depth=1)


def test_a_users_diagram_keeps_its_names(tmp_path):
    draw(users_own(), tmp_path / "own.svg")
    text = (tmp_path / "own.svg").read_text()
    assert "a&lt;b&gt;&amp;&quot;c" in text and ">s12<" in text


def test_a_single_block_can_be_drawn():
    gain = Gain(1.0, 1)
    gain.set_name("alone")
    assert "<B>alone</B>" in dot_text(gain)


@pytest.mark.parametrize(("suffix", "start"), [(".dot", b"digraph"), (".svg", b"<?xml"), (".png", b"\x89PNG")])
def test_the_suffix_says_the_format(tmp_path, suffix, start):
    draw(users_own(), tmp_path / f"own{suffix}")
    assert (tmp_path / f"own{suffix}").read_bytes().startswith(start)


def test_a_picture_replaces_the_old_one_and_leaves_nothing_beside(tmp_path):
    for _ in range(2):
        draw(users_own(), tmp_path / "own.dot")
    assert [file.name for file in tmp_path.iterdir()] == ["own.dot"]


@pytest.mark.parametrize("name", ["own.pdf", "own"])
def test_another_suffix_is_refused(tmp_path, name):
    assert all(suffix in refusal(users_own(), tmp_path / name) for suffix in (".dot", ".svg", ".png"))


def test_a_missing_folder_is_made(tmp_path):
    draw(users_own(), tmp_path / "new" / "x.dot")
    assert [file.name for file in (tmp_path / "new").iterdir()] == ["x.dot"]


def test_a_folder_in_the_way_is_refused(tmp_path):
    (tmp_path / "own.dot").mkdir()
    assert "cannot be written" in refusal(users_own(), tmp_path / "own.dot")


@pytest.mark.parametrize(("child", "advice"), [
    ("import no_such_library", "pip install pygraphviz"),
    ("import os; os.abort()", "draw own.dot instead"),
    ("", "draw own.dot instead"),
], ids=["missing", "crash", "silent"])
def test_a_failing_graphviz_is_one_sentence(tmp_path, monkeypatch, child, advice):
    monkeypatch.setattr(drawing, "_DRAW", child)
    message = refusal(users_own(), tmp_path / "own.svg")
    assert advice in message and "\n" not in message and not list(tmp_path.iterdir())


def test_a_dot_file_needs_no_pygraphviz(tmp_path):
    code = (
        "import sys; sys.modules['pygraphviz'] = None\n"
        "from pydrake.systems.primitives import Gain\nfrom drake_ispace.report.pictures.drawing import draw\n"
        f"draw(Gain(1.0, 1), {str(tmp_path / 'own.dot')!r})\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
    assert (tmp_path / "own.dot").exists()
