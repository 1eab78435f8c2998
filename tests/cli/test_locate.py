"""The commands `locate` and `calibrate`, scene files, and real footage of an overhead camera."""

import struct
import zlib
from dataclasses import replace

import cv2
import numpy as np
import pytest

from drake_ispace.blocks.errors import InputError
from drake_ispace.room.room import Space
from drake_ispace.vision.drawing.renderer import Renderer
from drake_ispace.vision.drawing.scene import marker_height, robot_box
from drake_ispace.vision.finding.patterns import Target
from drake_ispace.vision.footage.frames import frames
from drake_ispace.vision.footage.scene_file import load_scene, scene_eye, scene_names, scene_top
from drake_ispace.vision.image_localizer import COLOURS, targets
from drake_ispace.vision.optics.camera import view_of
from drake_ispace.vision.optics.top_view import trapezoid
from measurements import DATA

FOOTAGE = DATA / "overhead/vsss_static.mp4"
#: Read off the frame by eye [pixels].
ROBOTS = {
    "navy_light_blue": (250, 211), "green_lime": (427, 178), "red_lime": (447, 358), "red_navy": (50, 280),
    "navy_green": (75, 380), "light_blue_lime": (70, 412),
}
real = pytest.mark.skipif(not FOOTAGE.is_file(), reason=f"the footage {FOOTAGE} is not on this machine")
SPACE = Space()
POSES = {"omni": (-0.5, 0.2, 0.3), "pendulum": (0.5, -0.2, 2.0)}


@pytest.fixture(scope="module")
def picture(tmp_path_factory):
    """An image file of both robots in the room."""
    boxes = [robot_box(name, SPACE, pose) for name, pose in POSES.items()]
    file = tmp_path_factory.mktemp("room") / "room.png"
    cv2.imwrite(str(file), Renderer(view_of(SPACE.camera), SPACE.scenery).render(boxes).colour)
    return file


# Real footage


@pytest.fixture(scope="module")
def field():
    """The scene's eye and the footage's first frames."""
    return scene_eye(load_scene("vsss")), [image for (_, image), _ in zip(frames(FOOTAGE), range(25), strict=False)]


@real
def test_all_six_robots_are_found_within_4_pixels(field):
    eye, images = field
    for image in images:
        found = eye.locate(image)
        assert all(np.hypot(*(found[name].pixel - place)) < 4.0 for name, place in ROBOTS.items())


@real
def test_the_scene_looks_for_these_robots_alone():
    assert set(load_scene("vsss").robots) == set(ROBOTS)


@real
def test_no_robot_of_other_colour_pairs_is_found(field):
    eye, images = field
    colours, there = (
        list(load_scene("vsss").colours),
        {
            frozenset(pair)
            for pair in (
                ("navy", "light_blue"),
                ("green", "lime"),
                ("red", "lime"),
                ("red", "navy"),
                ("navy", "green"),
                ("light_blue", "lime"),
            )
        },
    )
    look = eye.looks[0]
    pattern = look.targets[0].pattern
    markers = {name: replace(pattern.markers[0], colour=name) for name in colours}
    others = tuple(
        Target(f"{a}/{b}", replace(pattern, markers=(markers[a], replace(pattern.markers[1], colour=b))))
        for i, a in enumerate(colours) for b in colours[:i] if frozenset((a, b)) not in there
    )
    eye = type(eye)(eye.size, [replace(look, targets=others)], eye.colours)
    assert len(others) == 4 and not any(eye.locate(images[0]).values())


@real
def test_a_robot_that_is_painted_over_is_not_seen(field):
    eye, images = field
    image = images[0].copy()
    cv2.rectangle(image, (410, 160), (450, 195), (30, 30, 30), -1)
    found = eye.locate(image)
    assert found["green_lime"] is None and sum(one is not None for one in found.values()) == 5


@real
def test_crosses_of_the_field_are_as_far_apart_as_they_are_painted():
    scene = load_scene("vsss")
    top = scene_top(scene)
    crosses = top.to_metres(top.from_image(np.array(scene.points)[:, :2]))
    assert np.hypot(*(crosses[:3] - crosses[3:]).T) == pytest.approx(0.75, rel=0.02)
    assert np.hypot(*(crosses[[0, 1, 3, 4]] - crosses[[1, 2, 4, 5]]).T) == pytest.approx(0.40, rel=0.02)


@real
def test_goal_areas_agree_with_the_crosses():
    # not used for the calibration: 1.2 m from front to front, 0.7 m wide
    top = scene_top(load_scene("vsss"))
    corners = top.to_metres(top.from_image([[97.0, 112.2], [98.3, 368.0], [539.4, 111.1], [542.2, 366.0]]))
    assert np.hypot(*(corners[:2] - corners[2:]).T) == pytest.approx(1.2, rel=0.03)
    assert np.hypot(*(corners[[0, 2]] - corners[[1, 3]]).T) == pytest.approx(0.7, rel=0.03)


@pytest.mark.slow
@real
def test_locate_as_json(document, field, tmp_path):
    writer = cv2.VideoWriter(str(tmp_path / "start.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 25.0, (640, 480))
    for image in field[1]:
        writer.write(image)
    writer.release()
    data = document("locate", tmp_path / "start.avi", "--scene", "vsss")
    assert len(data["frames"]) == 25 and data["frames"][1]["t"] == pytest.approx(0.04)
    for frame in data["frames"]:
        assert {robot["name"] for robot in frame["robots"]} == set(ROBOTS)
        assert all(set(robot) == {"name", "u", "v", "x", "y", "phi", "sure"} for robot in frame["robots"])


# Pictures of the room


@pytest.mark.slow
def test_robots_of_the_room_are_located(document, picture):
    (frame,) = document("locate", picture)["frames"]
    assert frame["t"] == 0.0
    for robot in frame["robots"]:
        assert [robot["x"], robot["y"], robot["phi"]] == pytest.approx(POSES[robot["name"]], abs=5e-3)


def test_the_table_names_every_robot(said, picture):
    text = said("locate", picture)
    assert "omni" in text and "1 of 1" in text and "0.2" in text


def test_an_annotated_picture_is_written(said, picture, tmp_path):
    said("locate", picture, "--out", tmp_path / "out")
    (file,) = (tmp_path / "out").iterdir()
    assert file.name == "located.png" and cv2.imread(str(file)).shape == (480, 640, 3)


def test_an_overlay_video_is_written(said, picture, tmp_path):
    image, video = cv2.imread(str(picture)), tmp_path / "in.avi"
    writer = cv2.VideoWriter(str(video), cv2.VideoWriter_fourcc(*"MJPG"), 10.0, (640, 480))
    for _ in range(4):
        writer.write(image)
    writer.release()
    said("locate", video, "--out", tmp_path / "out")
    assert {file.name for file in (tmp_path / "out").iterdir()} == {"located.png", "located.mp4"}
    assert len(list(frames(tmp_path / "out" / "located.mp4"))) == 4


def test_the_packaged_room_is_that_of_the_image_mode():
    scene = load_scene("room")
    assert (scene.width_m, scene.depth_m, scene.pixel_m) == (SPACE.width_m, SPACE.depth_m, SPACE.localizer.pixel_m)
    assert {n: (tuple(c.hue), c.saturation, c.value) for n, c in scene.colours.items()} == {
        n: (c.hue, c.saturation, c.value) for n, c in COLOURS.items()
    }
    for look in scene_eye(scene).looks:
        (one,) = look.targets
        (wanted,) = targets(SPACE, [one.name])
        assert (one.pattern.tolerance_m, one.pattern.elongation) == (
            wanted.pattern.tolerance_m, wanted.pattern.elongation)
        for marker, other in zip(one.pattern.markers, wanted.pattern.markers, strict=True):
            assert (marker.colour, marker.x_m, marker.y_m) == (other.colour, other.x_m, other.y_m)
            assert marker.area_m2 == pytest.approx(other.area_m2)
        assert scene.robots[one.name].height_m == marker_height(one.name, SPACE)


# Bad input


def test_a_missing_file_is_named(refused, tmp_path):
    assert "there is none" in refused("locate", tmp_path / "no.png")


@pytest.mark.parametrize(
    "name, content, message",
    [
        ("empty.png", b"", "is empty"),
        ("noise.png", b"no image", "no image can be read"),
        ("noise.mp4", b"no video" * 99, "no video"),
    ],
)
def test_files_without_a_picture_are_refused(refused, tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    assert message in refused("locate", tmp_path / name)


def announced_png(width, height):
    """A PNG file whose header says this size, with next to nothing in it."""
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", zlib.compress(bytes(1000))) + chunk(b"IEND", b"")


DAMAGED_BMP = b"BM" + struct.pack("<IHHIIiiHHIIiiII", 154, 0, 0, 54, 40, 2 * 10**9, 100, 1, 24, *[0] * 6) + bytes(100)


@pytest.mark.parametrize("name, content", [
    ("huge.png", announced_png(60000, 20000)), ("large.png", announced_png(20000, 20000)), ("bad.bmp", DAMAGED_BMP),
])
def test_an_image_that_announces_more_than_a_camera_makes_is_refused(refused, tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    assert "no image can be read" in refused("locate", tmp_path / name)


def test_a_truncated_image_is_no_robot_or_a_sentence(refused, picture, tmp_path):
    (tmp_path / "cut.png").write_bytes(picture.read_bytes()[:300])
    assert "no image can be read" in refused("locate", tmp_path / "cut.png")


@real
def test_a_truncated_video_is_refused(refused, tmp_path):
    (tmp_path / "cut.mp4").write_bytes(FOOTAGE.read_bytes()[:5000])
    assert "no video can be read" in refused("locate", tmp_path / "cut.mp4", "--scene", "vsss")


def test_an_image_of_another_size_is_refused(refused, tmp_path):
    cv2.imwrite(str(tmp_path / "small.png"), np.zeros((100, 100, 3), np.uint8))
    sentence = refused("locate", tmp_path / "small.png")
    assert "small.png" in sentence and "640 x 480" in sentence


def test_a_grey_image_shows_no_robot(document, tmp_path):
    cv2.imwrite(str(tmp_path / "grey.png"), np.full((480, 640), 128, np.uint8))
    assert document("locate", tmp_path / "grey.png") == {"frames": [{"t": 0.0, "robots": []}]}


def test_an_unknown_scene_is_refused(refused, picture):
    assert "did you mean 'vsss'" in refused("locate", picture, "--scene", "vss")


SCENE = """
points: [[0, 0, -1, 1], [600, 0, 1, 1], [600, 400, 1, -1], [0, 400, -1, -1]]
colours: {red: {hue: [170, 8]}, blue: {hue: [100, 120]}}
robots: {one: {front: red, rear: blue}}
"""


def test_a_scene_file_is_read(tmp_path):
    (tmp_path / "s.yaml").write_text(SCENE)
    assert list(scene_eye(load_scene(str(tmp_path / "s.yaml"))).colours) == ["red", "blue"]


@pytest.mark.parametrize("change, message", [
    (("front: red", "front: rod"), "robots.one: no colour 'rod', did you mean 'red'"),
    (("hue: [170, 8]", "hue: [170]"), r"colours.red: hue: expected a list of 2 values"),
    (("hue: [170, 8]", "hue: [200, 8]"), "at most 180"),
    (("[0, 0, -1, 1], ", "[0, 0, -1], "), r"points\[0\]: expected u, v, x, y"),
    (("[0, 0, -1, 1], ", ""), "expected at least four points"),
    (("[600, 400, 1, -1], [0, 400, -1, -1]", "[600, 0, 1, 1], [600, 0, 1, 1]"), "expected at least four points"),
    (("robots: {one: {front: red, rear: blue}}", ""), "robots: expected a mapping"),
    (("points", "pionts"), "unknown key"),
])
def test_bad_scene_files_are_refused(tmp_path, change, message):
    (tmp_path / "s.yaml").write_text(SCENE.replace(*change))
    with pytest.raises(InputError, match=message):
        scene_eye(load_scene(str(tmp_path / "s.yaml")))


def test_packaged_scenes():
    assert scene_names() == ["room", "vsss"]


# calibrate


def corner_texts():
    return [f"{u:.3f},{v:.3f}" for u, v in trapezoid(view_of(SPACE.camera), 2.5, 2.0)]


def test_calibrate_writes_the_camera_section(document, picture, tmp_path):
    options = [word for text in corner_texts() for word in ("--points", text)]
    data = document("calibrate", picture, *options, "--out", tmp_path / "camera.yaml")
    assert data["space"]["camera"]["height_m"] == pytest.approx(2.78, abs=1e-3) and data["rms_pixels"] < 0.1
    assert "height_m: 2.7" in (tmp_path / "camera.yaml").read_text()


def test_calibrate_wants_points_or_a_board(refused, picture):
    assert "either --points or --board" in refused("calibrate", picture)
    assert "no chessboard" in refused("calibrate", picture, "--board", "7,6,0.1,0,0,0")


def test_calibrate_refuses_points_outside_of_the_image(refused, picture):
    texts = ["9000,5", *corner_texts()[1:]]
    assert "lies outside of" in refused("calibrate", picture, *[w for t in texts for w in ("--points", t)])


def test_calibrate_refuses_corners_in_the_wrong_order(refused, picture):
    texts = corner_texts()[::-1]
    assert "--points: " in refused("calibrate", picture, *[w for t in texts for w in ("--points", t)])
