"""The command `scene learn`: colours and markers from pixels that one points at."""

import itertools

import cv2
import numpy as np
import pytest

from drake_ispace.blocks.errors import InputError
from drake_ispace.cli import vision as cli_vision
from drake_ispace.room.room import Scenery, Space
from drake_ispace.vision.drawing.renderer import Renderer
from drake_ispace.vision.drawing.scene import robot_box
from drake_ispace.vision.footage.frames import frames
from drake_ispace.vision.footage.learn import coloured_blobs, limits, read_heights, read_pointed
from drake_ispace.vision.footage.scene_file import load_scene, scene_eye
from drake_ispace.vision.optics.camera import view_of
from drake_ispace.vision.optics.top_view import trapezoid
from measurements import DATA

FOOTAGE = DATA / "overhead/vsss_static.mp4"
real = pytest.mark.skipif(not FOOTAGE.is_file(), reason=f"the footage {FOOTAGE} is not on this machine")
#: Pointed at by eye; the front marker first.
MARKERS = [
    "navy_light_blue:light_blue:256,212", "navy_light_blue:navy:244,208", "green_lime:lime:435,176",
    "green_lime:green:422,178", "red_lime:lime:453,357", "red_lime:red:441,358", "red_navy:red:48,275",
    "red_navy:navy:54,287", "navy_green:navy:74,372", "navy_green:green:75,386", "light_blue_lime:lime:77,411",
    "light_blue_lime:light_blue:63,411",
]
PLACES = {
    "navy_light_blue": (250, 211), "green_lime": (427, 178), "red_lime": (447, 358), "red_navy": (50, 280),
    "navy_green": (75, 380), "light_blue_lime": (70, 412),
}
SPACE = Space(scenery=Scenery(bayer=True, jpeg_quality=80))
POSES = {"omni": (-0.5, 0.2, 0.3), "pendulum": (0.5, -0.2, 2.0)}


def options(key, texts):
    return [word for text in texts for word in (key, text)]


@pytest.mark.slow
@real
def test_a_scene_learned_from_twelve_pixels_finds_all_six_robots(document, tmp_path, monkeypatch):
    monkeypatch.setattr(cli_vision, "_TRIED", 60)
    data = document("scene", "learn", FOOTAGE, "--scene", "vsss", *options("--marker", MARKERS), "--out",
                    tmp_path / "field.yaml")
    assert data["seen"] == dict.fromkeys(PLACES, data["frames"])
    eye = scene_eye(load_scene(str(tmp_path / "field.yaml")))
    for _, image in itertools.islice(frames(FOOTAGE), 0, None, 20):
        found = eye.locate(image)
        assert all(np.hypot(*(found[name].pixel - place)) < 2.0 for name, place in PLACES.items())
    assert cv2.imread(str(tmp_path / "field.png")).shape == (480, 640, 3)


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """A picture of both robots, and what one would point at in it."""
    view = view_of(SPACE.camera)
    boxes = [robot_box(name, SPACE, pose) for name, pose in POSES.items()]
    file = tmp_path_factory.mktemp("room") / "room.png"
    cv2.imwrite(str(file), Renderer(view, SPACE.scenery).render(boxes).colour)
    texts = []
    for name, colours, box in zip(POSES, (("red", "blue"), ("yellow", "green")), boxes, strict=True):
        for colour, x in zip(colours, (0.1, -0.1), strict=True):
            c, s = np.cos(box.yaw_rad), np.sin(box.yaw_rad)
            u, v = view.project([[box.x_m + c * x, box.y_m + s * x, box.top_m]])[0]
            texts.append(f"{name}:{colour}:{u + 2:.0f},{v - 1:.0f}")
    return file, texts


def learned(document, room, tmp_path, *more):
    file, texts = room
    document("scene", "learn", file, *options("--marker", texts), "--out", tmp_path / "own.yaml", *more)
    return load_scene(str(tmp_path / "own.yaml"))


@pytest.mark.slow
def test_a_learned_scene_finds_the_robots_elsewhere_too(document, room, tmp_path):
    eye = scene_eye(learned(document, room, tmp_path))
    renderer, rng, seen = Renderer(view_of(SPACE.camera), SPACE.scenery, seed=3), np.random.default_rng(0), 0
    for tick in range(20):
        poses = [(*rng.uniform([x, -0.7], [x + 0.7, 0.7]), rng.uniform(-3, 3)) for x in (-0.9, 0.2)]
        boxes = [robot_box(name, SPACE, pose) for name, pose in zip(POSES, poses, strict=True)]
        seen += sum(one is not None for one in eye.locate(renderer.render(boxes, tick=tick).colour).values())
    assert seen >= 39


def test_the_floor_may_be_pointed_at_as_well(document, room, tmp_path):
    corners = [f"{u:.1f},{v:.1f}" for u, v in trapezoid(view_of(SPACE.camera), 2.5, 2.0)]
    scene = learned(document, room, tmp_path, *options("--points", corners))
    assert scene.pixel_m == pytest.approx([0.0047, 0.0047], rel=0.15)
    assert len(scene.points) == 4 and set(scene.robots) == set(POSES)


def test_without_markers_it_lists_what_stands_out(said, room, tmp_path):
    text = said("scene", "learn", room[0], "--out", tmp_path / "look.yaml")
    assert all(word in text for word in ("red", "blue", "yellow", "green", "--marker"))
    assert [file.name for file in tmp_path.iterdir()] == ["look.png"]


def test_what_stands_out_is_where_one_would_point(room):
    found = coloured_blobs(cv2.imread(str(room[0])))
    for text in room[1]:
        _, colour, place = text.split(":")
        u, v = map(float, place.split(","))
        assert any(word == colour and np.hypot(a - u, b - v) < 5.0 for (a, b), word in found)


# -- Colours


def pixels(hue, saturation, value, spread=3.0, number=200):
    drawn = np.random.default_rng(0).normal([hue, saturation, value], [spread / 2.0, spread, spread], (number, 3))
    drawn[:, 0] %= 180.0
    return np.clip(drawn, 0, 255)


FLOOR = pixels(100.0, 15.0, 110.0)


def test_a_colour_reaches_half_way_to_its_neighbour():
    colours = limits({"green": pixels(60, 200, 150), "lime": pixels(48, 200, 150)}, FLOOR)
    assert colours["lime"].hue[1] == colours["green"].hue[0] == pytest.approx(54.0, abs=1.0)
    assert colours["green"].hue[1] == pytest.approx(73.0, abs=2.0)


def test_red_goes_through_the_end_of_the_hues():
    low, high = limits({"red": pixels(178, 200, 150)}, FLOOR)["red"].hue
    assert low == pytest.approx(165.0, abs=2.0) and high == pytest.approx(11.0, abs=2.0)


def test_pink_is_paler_than_red():
    colours = limits({"red": pixels(178, 220, 180), "pink": pixels(176, 90, 230)}, FLOOR)
    assert colours["pink"].most_saturation <= 155.0 and colours["red"].saturation == pytest.approx(155.0, abs=3.0)


def test_a_floor_of_the_same_hue_is_cut_off():
    assert limits({"blue": pixels(110, 200, 150)}, pixels(110, 60, 120))["blue"].saturation > 120.0


# -- Heights


def test_markers_are_measured_at_their_height(document, room, tmp_path):
    known = learned(document, room, tmp_path)  # as the packaged scene says
    assert [robot.height_m for robot in known.robots.values()] == [0.15, 0.30]
    assert known.robots["pendulum"].markers[0].x_m == pytest.approx(0.1, abs=0.002)
    flat = learned(document, room, tmp_path, "--height", "omni:0", "--height", "pendulum:0")
    assert flat.robots["pendulum"].markers[0].x_m > 0.105


@pytest.mark.parametrize("text", ["omni", "omni:", ":0.1", "omni:-1", "omni:x", "omni:nan"])
def test_heights_of_another_form_are_refused(text):
    with pytest.raises(InputError, match="--height: expected robot:metres"):
        read_heights([text])


# -- Bad input


@pytest.mark.parametrize("text", ["red:1,2", "a:red:1", "a:red:x,y", ":red:1,2", "a::1,2", "a:b:c:1,2", "a:red:nan,2"])
def test_markers_of_another_form_are_refused(text):
    with pytest.raises(InputError, match="--marker: expected robot:colour:u,v"):
        read_pointed([text])


def test_a_robot_with_one_marker_is_refused():
    with pytest.raises(InputError, match="robot 'a' has one marker only"):
        read_pointed(["a:red:1,2", "b:red:1,2", "b:blue:4,4"])


@pytest.mark.parametrize("change, message", [
    ({0: "omni:red:700,10"}, "expected a pixel within 640 x 480"),
    ({0: "omni:red:600,20"}, "no coloured marker|not found again|look alike"),
    ({1: "omni:other:{0}"}, "red and other look alike"),
])
def test_a_wrong_pixel_is_named(refused, room, tmp_path, change, message):
    file, texts = room[0], list(room[1])
    for i, text in change.items():
        texts[i] = text.replace("{0}", texts[0].rpartition(":")[2])
    sentence = refused("scene", "learn", file, *options("--marker", texts), "--out", tmp_path / "own.yaml")
    assert any(part in sentence for part in message.split("|")) and not list(tmp_path.iterdir())


def test_a_scene_file_has_the_name_of_one(refused, room, tmp_path):
    assert "a name that ends in .yaml" in refused("scene", "learn", room[0], "--out", tmp_path / "own.png")
