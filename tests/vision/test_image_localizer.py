"""The localiser on images: accuracy, what it refuses to guess, and its timing in the Diagram."""

import ctypes.util

import cv2
import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import VectorLogSink, ZeroOrderHold

from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.report.pictures.schedule import schedule
from drake_ispace.rollout.compile import compile_diagram
from drake_ispace.room.localizer import KinectLocalizer, Localizer
from drake_ispace.room.room import Camera, Space
from drake_ispace.scenario import load_scenario
from drake_ispace.simulation import simulate
from drake_ispace.vision.drawing.renderer import Renderer
from drake_ispace.vision.drawing.scene import PAINTS, Box, Patch, robot_box
from drake_ispace.vision.finding.markers import Colour, blobs
from drake_ispace.vision.image_localizer import (
    COLOURS,
    ImageLocalizer,
    frame_ticks,
    oldest_frame_ticks,
    room_eye,
)
from drake_ispace.vision.optics.camera import view_of
from drake_ispace.vision.optics.top_view import TopView, top_view_of, trapezoid
from drake_ispace.wiring.catalog import CATALOG, build_diagram

SPACE = Space()
NAMES = ("omni", "pendulum")


@pytest.fixture(scope="module")
def eye():
    return room_eye(SPACE, NAMES)


@pytest.fixture(scope="module")
def renderer():
    return Renderer(view_of(SPACE.camera), SPACE.scenery, seed=1)


def robots(omni=(-0.5, 0.2, 0.3), pendulum=(0.5, -0.2, 2.0)):
    return [robot_box(name, SPACE, pose) for name, pose in zip(NAMES, (omni, pendulum), strict=True)]


def slab(x, y, colour, side=0.09, height=0.02):
    """A painted thing on the floor or in the air."""
    return Box(
        x, y, 0.2, side, side, height, (50.0, 50.0, 50.0), patches=(Patch(0.0, 0.0, side, side, PAINTS[colour]),)
    )


def errors(found, pose):
    return np.hypot(found.x - pose[0], found.y - pose[1]), abs(np.angle(np.exp(1j * (found.phi - pose[2]))))


# The top view


def test_the_top_view_has_the_size_of_section_5_4():
    top = top_view_of(view_of(SPACE.camera), 2.5, 2.0, SPACE.localizer.pixel_m)
    assert top.size == (513, 363)
    assert top.pixel_m == pytest.approx((0.00487, 0.00551), abs=5e-6)


@pytest.mark.parametrize("distortion", [[0.0] * 5, [-0.1, 0.02, 0.0, 0.0, 0.0]])
def test_the_top_view_puts_places_where_they_are(distortion):
    view = view_of(Camera(distortion=distortion))
    top = top_view_of(view, 2.5, 2.0, SPACE.localizer.pixel_m, 0.15)
    places = np.random.default_rng(0).uniform([-1.2, -0.9], [1.2, 0.9], (40, 2))
    seen = view.project(np.column_stack([places, np.full(40, 0.15)]))
    assert top.to_metres(top.from_image(seen)) == pytest.approx(places, abs=1e-4)
    assert top.to_image(top.to_pixels(places)) == pytest.approx(seen, abs=0.05)


def test_warping_follows_the_same_geometry():
    view = view_of(Camera(distortion=[-0.1, 0.02, 0.0, 0.0, 0.0]))
    top = top_view_of(view, 2.5, 2.0, SPACE.localizer.pixel_m)
    image = np.zeros((480, 640), np.uint8)
    spot = np.rint(view.project([[0.4, 0.3, 0.0]])[0]).astype(int)
    cv2.circle(image, tuple(int(v) for v in spot), 4, 255, -1)
    moments = cv2.moments(top.warp(image), binaryImage=True)
    place = top.to_metres([[moments["m10"] / moments["m00"], moments["m01"] / moments["m00"]]])[0]
    assert place == pytest.approx([0.4, 0.3], abs=6e-3)


def test_a_marker_seen_at_the_wrong_height_is_seen_elsewhere():
    view, place = view_of(SPACE.camera), np.array([1.0, 0.8])
    floor = top_view_of(view, 2.5, 2.0, SPACE.localizer.pixel_m, 0.0)
    seen = view.project([[*place, 0.3]])
    away = floor.to_metres(floor.from_image(seen))[0] - place
    # parallax: h / (H - h) of the way from the camera's foot
    assert away == pytest.approx(0.3 / 2.48 * (place - SPACE.camera.foot_m), abs=1e-6)
    assert np.hypot(*away) > 0.2


# Poses


@pytest.mark.slow
def test_poses_over_the_space(eye, renderer):
    rng, gaps = np.random.default_rng(5), []
    for tick in range(20):
        poses = np.column_stack([rng.uniform([-1.05, -0.8], [-0.3, 0.8], (2, 2)), rng.uniform(-np.pi, np.pi, 2)])
        poses[1, 0] = -poses[1, 0]  # one in each half
        found = eye.locate(renderer.render(robots(*poses), tick=tick).colour)
        gaps += [errors(found[name], pose) for name, pose in zip(NAMES, poses, strict=True)]
    position, heading = np.array(gaps).T
    assert np.median(position) < 1e-3 and position.max() < 4e-3
    assert np.median(heading) < np.radians(0.3) and heading.max() < np.radians(1.5)


def test_edges_along_the_rows_of_the_picture_do_not_jump(eye, renderer):
    rng, gaps = np.random.default_rng(7), []
    for tick in range(8):
        pose = (rng.uniform(-1.0, -0.4), rng.uniform(-0.7, 0.7), tick % 4 * np.pi / 2.0)
        gaps.append(errors(eye.locate(renderer.render(robots(omni=pose), tick=tick).colour)["omni"], pose)[0])
    assert max(gaps) < 0.8e-3  # half a pixel would be 2.5 mm


@pytest.mark.slow
def test_600_poses_over_the_whole_space(eye, renderer):
    rng, gaps, unseen = np.random.default_rng(6), [], 0
    for tick in range(300):
        while True:
            poses = np.column_stack([rng.uniform([-1.09, -0.84], [1.09, 0.84], (2, 2)), rng.uniform(-np.pi, np.pi, 2)])
            if np.hypot(*(poses[0] - poses[1])[:2]) > 0.45:
                break
        found = eye.locate(renderer.render(robots(*poses), tick=tick).colour)
        unseen += sum(one is None for one in found.values())
        gaps += [errors(found[n], p) for n, p in zip(NAMES, poses, strict=True) if found[n] is not None]
    position, heading = np.array(gaps).T
    assert unseen < 0.03 * 600
    assert np.percentile(position, 50) <= 3e-3 and np.percentile(position, 95) <= 8e-3
    assert np.percentile(heading, 50) <= np.radians(1.0) and np.percentile(heading, 95) <= np.radians(2.5)
    assert position.max() < 0.02


def test_a_robot_that_is_not_there_is_not_seen(eye, renderer):
    found = eye.locate(renderer.render(robots()[:1]).colour)
    assert found["omni"] is not None and found["pendulum"] is None


def test_the_place_in_the_image_is_that_of_the_robots_middle(eye, renderer):
    found = eye.locate(renderer.render(robots()).colour)["omni"]
    assert found.pixel == pytest.approx(view_of(SPACE.camera).project([[-0.5, 0.2, 0.15]])[0], abs=0.3)


def test_a_hidden_marker_means_not_seen(eye, renderer):
    front = np.array([-0.5, 0.2]) + 0.1 * np.array([np.cos(0.3), np.sin(0.3)])
    bar = Box(*front, 0.8, 0.3, 0.06, 0.5, bottom_m=0.45)
    shift = 0.3 / 2.28 * (front - SPACE.camera.foot_m)  # onto the ray from the camera to the marker
    bar = bar.at(*(front - shift), 0.8)
    found = eye.locate(renderer.render([*robots(), bar]).colour)
    assert found["omni"] is None and found["pendulum"] is not None


@pytest.mark.parametrize("pose", [(1.18, 0.0, 0.0), (0.0, 0.93, np.pi / 2.0), (-1.2, -0.95, 1.0), (0.0, -1.5, 0.0)])
def test_a_marker_cut_by_the_border_means_not_seen(eye, renderer, pose):
    assert eye.locate(renderer.render(robots(omni=pose)).colour)["omni"] is None


def test_a_marker_of_too_few_pixels_means_not_seen(eye, renderer):
    small = Space()
    small.markers.side_m = 0.06
    assert eye.locate(renderer.render([robot_box("omni", small, (0.0, 0.0, 0.0))]).colour)["omni"] is None


@pytest.mark.parametrize("colour", ["orange", "purple"])
def test_things_of_near_colours_change_nothing(eye, renderer, colour):
    things = [slab(x, y, colour, side, 0.15) for x, y, side in ((-0.3, 0.2, 0.09), (-0.5, 0.45, 0.09), (0.4, 0.1, 0.3))]
    found = eye.locate(renderer.render([*robots(), *things]).colour)
    assert errors(found["omni"], (-0.5, 0.2, 0.3))[0] < 4e-3 and errors(found["pendulum"], (0.5, -0.2, 2.0))[0] < 4e-3


def test_a_second_pair_of_the_same_colours_means_not_seen(eye, renderer):
    twin = robot_box("omni", SPACE, (0.0, 0.7, 1.0))
    found = eye.locate(renderer.render([*robots(), twin]).colour)
    assert found["omni"] is None and found["pendulum"] is not None


def test_one_marker_alone_is_no_robot(eye, renderer):
    assert eye.locate(renderer.render([slab(0.0, 0.0, "red", height=0.15)]).colour) == {"omni": None, "pendulum": None}


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((480, 640, 3), np.uint8),
        np.full((480, 640, 3), 128, np.uint8),
        np.full((480, 640, 3), (30, 20, 200), np.uint8),
        np.random.default_rng(0).integers(0, 256, (480, 640, 3), dtype=np.uint8),
    ],
    ids=["black", "grey", "all red", "random"],
)
def test_pictures_without_robots(eye, image):
    assert eye.locate(image) == {"omni": None, "pendulum": None}


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((240, 320, 3), np.uint8),
        np.zeros((480, 640), np.uint8),
        np.zeros((480, 640, 3)),
        np.zeros((0, 0, 3), np.uint8),
        None,
    ],
    ids=["small", "one channel", "float", "empty", "none"],
)
def test_pictures_of_another_kind_are_refused(eye, image):
    with pytest.raises(InputError, match="expected an image of 640 x 480 pixels with 3 colours of 8 bit"):
        eye.locate(image)


def test_width_is_said_before_height(eye):
    with pytest.raises(InputError, match=r"640 x 480 pixels .*, got 632 x 468 with 3 of 8 bit"):
        eye.locate(np.zeros((468, 632, 3), np.uint8))


def test_a_colour_that_is_paler_is_another_one():
    hsv = np.array([[[175, 90, 220], [175, 200, 220], [175, 200, 90]]], np.uint8)
    red, pink = Colour((170.0, 5.0), 150.0, 60.0), Colour((170.0, 5.0), 60.0, 60.0, most_saturation=149.0)
    dark = Colour((170.0, 5.0), 60.0, 60.0, most_value=100.0)
    assert [(colour.mask(hsv) > 0).tolist()[0] for colour in (red, pink, dark)] == [
        [False, True, True], [True, False, False], [False, False, True],
    ]


def test_hue_ranges_go_through_red():
    hsv = np.array([[[178, 200, 200], [3, 200, 200], [90, 200, 200]]], np.uint8)
    assert COLOURS["red"].mask(hsv).tolist() == [[255, 255, 0]]


def test_a_blob_is_measured():
    top = TopView(trapezoid(view_of(SPACE.camera), 2.5, 2.0), 2.5, 2.0, SPACE.localizer.pixel_m)
    mask = np.zeros((363, 513), np.uint8)
    mask[100:110, 200:220] = 255
    (blob,) = blobs(mask, top, 0.0, 1.0)
    assert list(blob.pixel) == [209.5, 104.5]
    assert blob.area_m2 == pytest.approx(200 * 2.5 / 513 * 2.0 / 363)
    assert blob.elongation == pytest.approx(20 * 4.873 / (10 * 5.510), rel=0.01)


def test_a_grey_marker_is_weighed_by_its_area():
    top = TopView(trapezoid(view_of(SPACE.camera), 2.5, 2.0), 2.5, 2.0, SPACE.localizer.pixel_m)
    mask = np.zeros((363, 513), np.uint8)
    mask[100:110, 200:220] = 255
    (blob,) = blobs(mask, top, 0.0, 1.0, share=np.zeros((363, 513)))
    assert list(blob.pixel) == [209.5, 104.5]


# The block


def small_space(**localizer):
    """Few pixels: enough for timing."""
    return Space(camera=Camera(size_pixels=[160, 120]), localizer=Localizer(mode="image", **localizer))


def messages(space, ticks, poses=(-0.5, 0.2, 0.3), names=("omni",)):
    """(ticks, 5 n): what a block that computes in tick 0, 1, ... sees."""
    builder = DiagramBuilder()
    kinect = builder.AddSystem(ImageLocalizer(space, names))
    reader = builder.AddSystem(ZeroOrderHold(TICK_S, 5 * len(names)))
    log = builder.AddSystem(VectorLogSink(5 * len(names), TICK_S))
    builder.Connect(kinect.get_output_port(), reader.get_input_port())
    builder.Connect(reader.get_output_port(), log.get_input_port())
    diagram = builder.Build()
    simulator = Simulator(diagram)
    kinect.get_input_port().FixValue(
        kinect.GetMyMutableContextFromRoot(simulator.get_mutable_context()), np.array(poses)
    )
    simulator.AdvanceTo(ticks * TICK_S)
    return log.FindLog(simulator.get_context()).data().T[1:]


def test_the_ports_are_those_of_the_geometric_localiser():
    image, geometric = ImageLocalizer(small_space(), NAMES), KinectLocalizer(SPACE, 2)
    for block in (image, geometric):
        assert [block.get_input_port().get_name(), block.get_input_port().size()] == ["poses", 6]
        assert [block.get_output_port().get_name(), block.get_output_port().size()] == ["fixes", 10]


def test_frames_of_30_hz_fall_on_ticks():
    assert frame_ticks(30.0) == (20, [0, 7, 14]) and oldest_frame_ticks(30.0) == 6
    assert frame_ticks(0.0) == (19, [0]) and oldest_frame_ticks(0.0) == 0
    assert frame_ticks(200.0) == (1, [0]) and oldest_frame_ticks(50.0) == 3


@pytest.mark.parametrize("latency", [0, 5, 19, 25])
def test_a_message_is_the_latest_frame_a_latency_later(latency):
    rows = messages(small_space(latency_ticks=latency), 120)
    frames = sorted(t for k in range(7) for t in (20 * k, 20 * k + 7, 20 * k + 14))
    for tick, stamp in enumerate(rows[:, 0]):
        look = 19 * ((tick - latency) // 19)
        assert stamp == (max(t for t in frames if t <= look) if tick >= latency else -1.0), tick


def test_without_a_frame_rate_each_message_has_its_own_frame():
    space = small_space()
    space.camera.frame_rate_hz = 0.0
    assert list(messages(space, 60)[::19, 0]) == [0.0, 19.0, 38.0, 57.0]


def test_the_block_sees_both_robots():
    row = messages(Space(localizer=Localizer(mode="image")), 1, (-0.5, 0.2, 0.3, 0.5, -0.2, 2.0), NAMES)[0]
    assert row == pytest.approx([0.0, 1.0, -0.5, 0.2, 0.3, 0.0, 1.0, 0.5, -0.2, 2.0], abs=0.01)


def test_drop_outs_and_robots_out_of_sight():
    assert list(messages(small_space(dropout=1.0), 1)[0]) == [0.0, 0.0, 0.0, 0.0, 0.0]
    assert list(messages(small_space(), 1, (3.0, 0.0, 0.0))[0]) == [0.0, 0.0, 0.0, 0.0, 0.0]


def test_the_schedule_shows_the_camera_and_the_message():
    scenario = load_scenario("shared_space", ["space.localizer.mode=image", "space.camera.size_pixels=[160, 120]"])
    rows = [row for row in schedule(build_diagram(scenario)) if row["block"] == "kinect"]
    assert [(row["phase"], row["period_ticks"]) for row in rows] == [("sense", 20)] * 3 + [("sense", 19)] * 2


@pytest.mark.parametrize("name", CATALOG)
def test_every_diagram_takes_the_image_mode(name):
    settings = ["space.localizer.mode=image", "space.camera.size_pixels=[160, 120]", "seconds=0.1"]
    assert simulate(load_scenario(name, settings)).diverged_s is None


@pytest.mark.parametrize(
    "setting, message",
    [
        ("space.camera.height_m=0.1", "in front of and below it"),
        ("space.camera.foot_m=[0, 9]", "in front of and below it"),
        ("space.localizer.pixel_m=[1e-05, 1e-05]", "top view of at most"),
        ("space.camera.size_pixels=[4096, 4096]", "pixels to render"),
        ("space.camera.pitch_rad=-1.0", "does not look down"),
        ("space.scenery.obstacles=[[1.0]]", "expected x, y, yaw"),
    ],
)
def test_a_room_that_cannot_be_seen_is_refused(setting, message):
    settings = ["space.localizer.mode=image", "space.camera.size_pixels=[160, 120]", setting]
    scenario = load_scenario("omni_multirate", settings)
    with pytest.raises(InputError, match=message):
        build_diagram(scenario)


def test_a_compiled_rollout_refuses_it():
    scenario = load_scenario("omni_multirate", ["space.localizer.mode=image", "space.camera.size_pixels=[160, 120]"])
    with pytest.raises(
        InputError, match="kinect: the maths of ImageLocalizer are no kernels, so it cannot be compiled"
    ):
        compile_diagram(build_diagram(scenario))


@pytest.mark.first_case
@pytest.mark.parametrize("name", ["omni", "pendulum"])
def test_a_robot_drives_on_images(name):
    run = simulate(load_scenario(f"{name}_multirate", ["seconds=1.5", "space.localizer.mode=image"]))
    fixes = run.signals[f"{name}_fix"]
    assert (fixes[fixes[:, 0] >= 0.0, 1] == 1.0).all()
    pose = run.signals[f"{name}_pose"][50:]
    gap = run.signals[f"{name}_estimate"][50:, -3:] - pose
    if name == "pendulum":  # whose top leans forward with it
        gap[:, 0] -= 0.22 * np.sin(run.signals["pendulum_balance"][50:, 0]) * np.cos(pose[:, 2])
    assert np.abs(gap[:, :2]).max() < 8e-3


def test_a_tilted_top_is_seen_where_it_is():
    space, axle, tilt, pose = Space(localizer=Localizer(mode="image")), 0.08, 0.06, np.array([0.2, -0.1, 0.7])
    block = ImageLocalizer(space, ("omni", "pendulum"), 0, {"pendulum": axle})
    found = []
    for lean in (0.0, tilt):
        context = block.CreateDefaultContext()
        block.GetInputPort("poses").FixValue(context, np.concatenate([[-0.6, 0.3, 0.0], pose]))
        block.GetInputPort("balance").FixValue(context, [lean, 0.0, 0.0, 0.0])
        simulator = Simulator(block, context)
        simulator.AdvanceTo(0.5 * TICK_S)
        found.append(block.GetOutputPort("fixes").Eval(context).reshape(2, -1)[1])
    assert found[0][1] == found[1][1] == 1.0
    shift = (found[1] - found[0])[2:4]
    height = space.markers.pendulum_height_m
    assert shift @ [np.cos(0.7), np.sin(0.7)] == pytest.approx((height - axle) * np.sin(tilt), abs=2e-3)


def test_a_robot_drives_on_drakes_own_renderer():
    if ctypes.util.find_library("EGL") is None:
        pytest.skip("libEGL is not on this machine")
    settings = ["seconds=0.5", "space.localizer.mode=image", "space.scenery.renderer=vtk"]
    fixes = simulate(load_scenario("omni_multirate", settings)).signals["omni_fix"]
    assert (fixes[fixes[:, 0] >= 0.0, 1] == 1.0).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["omni", "pendulum"])
def test_the_square_on_images_is_that_of_the_fitted_geometric_mode(name):
    square = ["seconds=20", f"{name}.trajectory.kind=square"]
    fitted = [
        "space.localizer.whole_pixels=false",
        "space.localizer.noise_std_pixels=0.02",
    ]
    errors = []
    for mode in (["space.localizer.mode=image"], fitted):
        run = simulate(load_scenario(f"{name}_multirate", square + mode))
        way, pose = run.signals[f"{name}_way_point"], run.signals[f"{name}_pose"]
        shown = way[:, 0] >= 0.0
        errors.append(np.sqrt(((way[shown, 1:3] - pose[shown, :2]) ** 2).sum(axis=1).mean()))
    assert errors[0] == pytest.approx(errors[1], rel=0.1)
