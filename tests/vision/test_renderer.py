"""The rendered room: rays, depth, paint, shadows, noise, blur, and agreement with Drake's own renderer."""

import ctypes.util

import numpy as np
import pytest
from camera_geometry import to_plane

from drake_ispace.blocks.errors import InputError
from drake_ispace.room.room import Camera, Scenery, Space
from drake_ispace.vision.drawing.renderer import Picture, Renderer, hit, with_noise
from drake_ispace.vision.drawing.scene import PAINTS, Box, obstacles, robot_box
from drake_ispace.vision.image_localizer import room_eye, room_renderer
from drake_ispace.vision.optics.camera import view_of

SPACE = Space()
VIEW = view_of(SPACE.camera)
CLEAN = Scenery(
    carpet_contrast=0.0, light_gradient=0.0, shadow=0.0, noise_grey_levels=0.0, light_noise_grey_levels=0.0,
    depth_noise_m=0.0,
)
NAMES = ("omni", "pendulum")
SMALL = view_of(Camera(size_pixels=[160, 120]))


@pytest.fixture(scope="module")
def clean():
    return Renderer(VIEW, CLEAN)


@pytest.fixture(scope="module")
def real():
    return Renderer(VIEW, SPACE.scenery, seed=3)


def at(image, place, view=VIEW):
    """The pixel that sees a point in W."""
    u, v = np.rint(view.project([place])[0]).astype(int)
    return image[v, u]


def test_rays_meet_a_box_where_they_should():
    box = Box(2.0, 0.0, 0.0, 1.0, 1.0, 1.0)
    rays = np.array([[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, -1.0]])
    distance, top = hit(box, np.array([0.0, 0.2, 0.5]), rays)
    assert list(distance) == [1.5, np.inf, np.inf] and not top.any()
    distance, top = hit(box, np.array([2.0, 0.0, 3.0]), rays)
    assert list(distance) == [np.inf, np.inf, 2.0] and list(top) == [False, False, True]


def test_depth_of_the_floor_is_that_of_geometry(clean):
    depth = clean.draw().depth
    grid = VIEW.pixel_grid()[::997]
    points = np.column_stack([to_plane(VIEW, grid), np.zeros(len(grid))])
    expected = (points - VIEW.p_ws) @ VIEW.r_ws[:, 0]
    assert depth.ravel()[::997] == pytest.approx(expected, abs=1e-5)


def test_depth_of_a_robots_top(clean):
    depth = clean.draw([robot_box("pendulum", SPACE, (0.2, 0.1, 0.4))]).depth
    top = np.array([0.2, 0.1, SPACE.markers.pendulum_height_m])
    u, v = np.rint(VIEW.project([top])[0]).astype(int)
    ray = VIEW.rays([[u, v]])[0]
    assert depth[v, u] == pytest.approx((top[2] - VIEW.p_ws[2]) / ray[2], abs=1e-5)


def test_markers_have_their_paint_where_they_are_projected(clean):
    picture = clean.draw([robot_box("omni", SPACE, (-0.4, 0.3, np.pi / 2.0))])
    assert at(picture.colour, (-0.4, 0.4, 0.15)) == pytest.approx(PAINTS["red"], abs=0.1)
    assert at(picture.colour, (-0.4, 0.2, 0.15)) == pytest.approx(PAINTS["blue"], abs=0.1)


def test_the_nearer_of_two_boxes_is_seen(clean):
    low, high = (
        Box(0.0, 0.0, 0.0, 0.4, 0.4, 0.1, (0.0, 0.0, 255.0)),
        Box(0.0, 0.0, 0.0, 0.2, 0.2, 0.3, (255.0, 0.0, 0.0)),
    )
    for boxes in ([low, high], [high, low]):
        assert at(clean.draw(boxes).colour, (0.0, 0.0, 0.3)) == pytest.approx([255.0, 0.0, 0.0], abs=0.1)


def test_the_background_is_what_a_whole_drawing_gives():
    box = Box(0.5, 0.3, 0.3, 0.3, 0.2, 0.25)
    drawn = [Renderer(SMALL, CLEAN, static).draw(moving).colour for static, moving in (((box,), []), ((), [box]))]
    assert np.abs(drawn[0] - drawn[1]).max() < 1e-3


def test_a_shadow_darkens_the_floor_beside_a_box(real):
    alone, with_box = real.draw().colour, real.draw([Box(0.0, 0.0, 0.0, 0.3, 0.3, 0.3)]).colour
    shadow = at(with_box, (-0.18, 0.05, 0.0)) / at(alone, (-0.18, 0.05, 0.0))
    assert shadow == pytest.approx(1.0 - SPACE.scenery.shadow, abs=0.02)
    assert at(with_box, (0.6, 0.5, 0.0)) == pytest.approx(at(alone, (0.6, 0.5, 0.0)))


def test_light_falls_off_along_the_width():
    bright = Renderer(SMALL, Scenery(carpet_contrast=0.0, light_gradient=0.3)).draw().colour
    assert at(bright, (1.0, 0.0, 0.0), SMALL) / at(bright, (-1.0, 0.0, 0.0), SMALL) == pytest.approx(
        1.12 / 0.88, abs=0.01
    )


def test_a_picture_depends_on_seed_and_tick_alone():
    boxes = [robot_box("omni", SPACE, (0.1, 0.2, 0.3))]
    one, again, other = (Renderer(SMALL, SPACE.scenery, seed=seed) for seed in (3, 3, 4))
    picture, same = one.render(boxes, tick=19), again.render(boxes, tick=19)
    assert np.array_equal(picture.colour, same.colour) and np.array_equal(picture.depth, same.depth)
    assert not np.array_equal(picture.colour, one.render(boxes, tick=38).colour)
    assert not np.array_equal(picture.colour, other.render(boxes, tick=19).colour)


def test_noise_has_its_strength(clean):
    scenery = Scenery(noise_grey_levels=3.0, light_noise_grey_levels=0.0, depth_noise_m=0.0012)
    picture = with_noise(clean.draw(), scenery, 0, 0)
    assert picture.colour.dtype == np.uint8
    assert (picture.colour - clean.draw().colour)[200:300].std() == pytest.approx(
        np.hypot(3.0, 1 / np.sqrt(12)), rel=0.02
    )
    gap = (picture.depth - clean.draw().depth) / clean.draw().depth ** 2
    assert gap.std() == pytest.approx(0.0012, rel=0.01)


@pytest.mark.parametrize("level, expected", [(0.0, 2.0), (64.0, np.sqrt(4.0 + 9.0 * 64.0 / 255.0)), (200.0, 3.325)])
def test_noise_grows_with_the_light(level, expected):
    even = Picture(np.full((200, 200, 3), level), np.zeros((200, 200)))
    noisy = with_noise(even, Scenery(noise_grey_levels=2.0, light_noise_grey_levels=3.0), 0, 0).colour
    spread = noisy[noisy > 0].std() if level else np.sqrt((noisy.astype(float) ** 2).mean() * 2.0)
    assert spread == pytest.approx(expected, rel=0.03)


def test_behind_a_bayer_pattern_even_light_stays_and_edges_get_colours():
    even = Picture(np.tile([40.0, 90.0, 160.0], (50, 50, 1)), np.zeros((50, 50)))
    scenery = Scenery(**{**vars(CLEAN), "bayer": True})
    assert (with_noise(even, scenery, 0, 0).colour[2:-2, 2:-2] == [40, 90, 160]).all()
    edge = Picture(np.where(np.arange(50)[None, :, None] < 25, 40.0, 200.0) * np.ones((50, 50, 3)), np.zeros((50, 50)))
    colour = with_noise(edge, scenery, 0, 0).colour.astype(int)[2:-2, 2:-2]
    assert np.ptp(colour, axis=2).max() > 20 and np.ptp(colour, axis=2)[:, :15].max() == 0


def test_jpeg_of_a_lower_quality_changes_more(clean):
    picture = clean.draw([robot_box("omni", SPACE, (0.0, 0.0, 0.4))])
    changes = []
    for quality in (95, 40):
        shown = with_noise(picture, Scenery(**{**vars(CLEAN), "jpeg_quality": quality}), 0, 0).colour
        changes.append(np.abs(shown - picture.colour).mean())
    assert 0.0 < changes[0] < 0.5 * changes[1]


def test_a_tilted_box_turns_about_its_axle():
    box = Box(1.0, 2.0, np.pi / 2.0, 0.3, 0.2, 0.3, pitch_rad=0.2, axle_m=0.08)
    top = np.array([1.0, 2.0 + 0.22 * np.sin(0.2), 0.08 + 0.22 * np.cos(0.2)])  # its nose points along y of W
    assert box.own(top) == pytest.approx([0.0, 0.0, 0.3], abs=1e-12)
    corners = box.corners()
    assert box.own(corners) == pytest.approx(np.array([
        [x, y, z] for z in (0.0, 0.3) for x, y in ((0.15, 0.1), (-0.15, 0.1), (-0.15, -0.1), (0.15, -0.1))
    ]), abs=1e-12)
    above = np.array([*top[:2], 2.0])
    distance, is_top = hit(box, above, np.array([0.0, 0.0, -1.0]))
    assert 2.0 - distance == pytest.approx(top[2], abs=1e-9) and is_top


def test_motion_blurs_without_a_shift(clean):
    box = robot_box("omni", SPACE, (0.0, 0.0, 0.0))
    still, moving = clean.draw([box]).colour, clean.draw([box], [(0.05, 0.0, 0.0)]).colour

    def red(picture):
        weight = np.clip(picture[..., 2] - picture[..., 0], 0.0, None)
        columns = weight.sum(axis=0)
        middle = (columns * np.arange(len(columns))).sum() / columns.sum()
        return middle, np.sqrt((columns * (np.arange(len(columns)) - middle) ** 2).sum() / columns.sum())

    assert red(moving)[0] == pytest.approx(red(still)[0], abs=0.3)
    assert red(moving)[1] > 1.05 * red(still)[1]


def test_a_robot_outside_of_the_picture_changes_nothing(clean):
    assert np.array_equal(clean.draw([robot_box("omni", SPACE, (9.0, 0.0, 0.0))]).colour, clean.draw().colour)


@pytest.mark.parametrize("numbers", [[0.0, 0.0, 0.0, 0.3, 0.2], [0.0, 0.0, 0.0, 0.3, 0.2, 0.0]])
def test_a_box_without_size_is_refused(numbers):
    space = Space(scenery=Scenery(obstacles=[numbers]))
    with pytest.raises(InputError, match=r"space.scenery.obstacles\[0\]: expected x, y, yaw, length"):
        obstacles(space)


def test_no_libegl_gives_a_sentence(monkeypatch):
    monkeypatch.setattr(ctypes.util, "find_library", lambda name: None)
    with pytest.raises(InputError, match="needs the system library libEGL"):
        room_renderer(Space(scenery=Scenery(renderer="vtk")))


@pytest.fixture(scope="module")
def both(clean):
    """The same scene by both renderers."""
    if ctypes.util.find_library("EGL") is None:
        pytest.skip("libEGL is not on this machine, so Drake's VTK renderer cannot be compared")
    static = (Box(0.6, 0.5, 0.3, 0.3, 0.2, 0.25), Box(-0.8, -0.4, 0.0, 0.25, 0.2, 0.35))
    robots = [robot_box("omni", SPACE, (0.3, -0.5, 0.5)), robot_box("pendulum", SPACE, (-0.3, 0.5, 2.5), 0.06, 0.08)]
    space = Space(scenery=Scenery(**{**vars(CLEAN), "renderer": "vtk", "obstacles": [
        [b.x_m, b.y_m, b.yaw_rad, b.length_m, b.width_m, b.top_m] for b in static
    ]}))
    return clean.draw([*static, *robots]), room_renderer(space).draw(robots), space


def test_both_renderers_agree_in_depth_but_for_edges(both):
    one, other, _ = both
    gap = np.abs(one.depth - other.depth)
    assert np.mean(gap > 2e-3) < 1e-4 and np.median(gap) < 1e-5


def test_both_renderers_agree_in_colour_but_for_edges_and_upright_faces(both):
    one, other, _ = both
    rows = VIEW.p_ws + one.depth[..., None] * VIEW.rays(VIEW.pixel_grid()).reshape(480, 640, 3)
    flat = np.min([np.abs(rows[..., 2] - h) for h in (0.0, 0.15, 0.25, 0.35)], axis=0) < 1e-3
    gap = np.abs(one.colour - other.colour).max(axis=2)[flat]
    assert np.mean(gap > 2.0) < 0.006


def test_robots_are_found_alike_in_both_renderings(both):
    one, other, space = both
    eye = room_eye(space, NAMES)
    seen, seen_too = (eye.locate(p.colour.astype(np.uint8)) for p in (one, other))
    for name in NAMES:
        gap = np.hypot(seen[name].x - seen_too[name].x, seen[name].y - seen_too[name].y)
        assert gap < 2e-3 and abs(seen[name].phi - seen_too[name].phi) < 0.01


def test_the_second_renderer_knows_no_distortion():
    if ctypes.util.find_library("EGL") is None:
        pytest.skip("libEGL is not on this machine")
    with pytest.raises(InputError, match="knows no lens distortion"):
        room_renderer(Space(camera=Camera(distortion=[0.1, 0.0, 0.0, 0.0, 0.0]), scenery=Scenery(renderer="vtk")))
