"""The depth image as a map: (5.5) as corrected, obstacles, free space, robots told from obstacles."""

import numpy as np
import pytest
from camera_geometry import printed_vectors

from drake_ispace.blocks.errors import InputError
from drake_ispace.room.room import Camera, Space
from drake_ispace.vision.depth_map import (
    CELL_M,
    FREE,
    OBSTACLE,
    ROBOT,
    UNKNOWN,
    free_space_overlap,
    map_of,
    points,
    true_cells,
)
from drake_ispace.vision.drawing.renderer import Renderer
from drake_ispace.vision.drawing.scene import Box, robot_box
from drake_ispace.vision.optics.camera import rotation_z, view_of

SPACE = Space()
VIEW = view_of(SPACE.camera)
RAYS = VIEW.rays(VIEW.pixel_grid()).reshape(480, 640, 3)
BOXES = (
    Box(0.6, 0.5, 0.3, 0.30, 0.20, 0.25), Box(-0.8, -0.4, 0.0, 0.25, 0.20, 0.35), Box(0.1, 0.1, 1.0, 0.30, 0.15, 0.12),
)
ROBOT_BOX = robot_box("omni", SPACE, (0.4, -0.5, 0.5))


@pytest.fixture(scope="module")
def depth():
    """With noise."""
    return Renderer(VIEW, SPACE.scenery, BOXES, seed=2).render([ROBOT_BOX]).depth


@pytest.fixture(scope="module")
def room(depth):
    return map_of(VIEW, depth, SPACE.width_m, SPACE.depth_m, [ROBOT_BOX.footprint(0.04)])


def cell(room, x, y):
    return room.cells[int((1.0 - y) / CELL_M), int((x + 1.25) / CELL_M)]


def nearest(room, box):
    return min(room.obstacles, key=lambda o: np.hypot(o.x_m - box.x_m, o.y_m - box.y_m))


def test_the_points_of_a_flat_floor_lie_on_it():
    depth = -VIEW.p_ws[2] / RAYS[..., 2]
    assert np.abs(points(VIEW, depth)[..., 2]).max() < 1e-9


def test_5_5_as_corrected_and_as_printed_agree_in_the_middle_only():
    camera, depth = Camera(), 2.9 / np.linalg.norm(RAYS, axis=2)
    d = points(VIEW, depth) - VIEW.p_ws
    turned = rotation_z(camera.foot_yaw_rad)
    middle = turned @ printed_vectors(camera, [[319.5, 239.5]], [2.9])[0]
    assert d[239:241, 319:321].mean(axis=(0, 1)) == pytest.approx(middle, abs=1e-4)
    edge = turned @ printed_vectors(camera, [[639.0, 239.5]], [2.9])[0]
    assert np.linalg.norm(d[239, 639] - edge) > 0.9


def test_pixels_without_depth_are_nowhere():
    depth = np.full((480, 640), 2.9)
    depth[10, 20], depth[11, 20] = 0.0, np.nan
    assert np.isnan(points(VIEW, depth)[10:12, 20]).all()


@pytest.mark.parametrize("box", BOXES)
def test_footprints_are_right_within_3_cm(room, box):
    found = nearest(room, box)
    outline = Box(found.x_m, found.y_m, found.yaw_rad, found.length_m, found.width_m, found.height_m).footprint()
    gaps = np.hypot(*(outline[:, None] - box.footprint()[None]).transpose(2, 0, 1))
    assert max(gaps.min(axis=0).max(), gaps.min(axis=1).max()) < 0.03


@pytest.mark.parametrize("box", BOXES)
def test_sizes_of_obstacles(room, box):
    found = nearest(room, box)
    assert found.height_m == pytest.approx(box.top_m, abs=0.005)
    assert (found.length_m, found.width_m) == pytest.approx((box.length_m, box.width_m), abs=0.015)
    assert abs(np.sin(found.yaw_rad - box.yaw_rad)) < 0.06


def test_there_are_as_many_obstacles_as_boxes(room):
    assert len(room.obstacles) == len(BOXES)


def test_free_space_overlaps_that_of_the_scene(room):
    truth = true_cells([*BOXES, ROBOT_BOX], SPACE.width_m, SPACE.depth_m)
    assert free_space_overlap(room.cells, truth) >= 0.95
    known = room.cells != UNKNOWN
    assert free_space_overlap(room.cells[known], truth[known]) >= 0.98


def test_the_robot_is_told_from_the_obstacles(room):
    assert cell(room, 0.4, -0.5) == ROBOT
    assert cell(room, -0.8, -0.4) == OBSTACLE
    assert cell(room, -0.3, 0.6) == FREE


def test_what_a_box_hides_is_unknown(room):
    assert cell(room, -0.88, -0.25) == UNKNOWN


def test_a_robot_that_was_not_found_is_an_obstacle(depth):
    room = map_of(VIEW, depth, SPACE.width_m, SPACE.depth_m)
    assert cell(room, 0.4, -0.5) == OBSTACLE and len(room.obstacles) == len(BOXES) + 1


def test_an_empty_room_is_free():
    depth = Renderer(VIEW, SPACE.scenery).render().depth
    room = map_of(VIEW, depth, SPACE.width_m, SPACE.depth_m)
    assert not room.obstacles and np.mean(room.cells == FREE) > 0.999


@pytest.mark.parametrize("depth", [np.zeros((480, 640)), np.full((480, 640), np.nan)])
def test_without_any_depth_nothing_is_known(depth):
    room = map_of(VIEW, depth, SPACE.width_m, SPACE.depth_m)
    assert (room.cells == UNKNOWN).all() and not room.obstacles


def test_a_depth_image_of_another_size_is_refused():
    with pytest.raises(InputError, match="depth image: expected 640 x 480 pixels"):
        map_of(VIEW, np.zeros((240, 320)), 2.5, 2.0)


def test_true_cells_by_hand():
    cells = true_cells([Box(0.0, 0.0, 0.0, 0.2, 0.12, 0.3)], 1.0, 1.0, 0.1)
    assert (cells == OBSTACLE).sum() == 4  # the middles of four cells, 0.05 m from the axes, lie inside


def test_overlap_by_hand():
    one, other = np.array([FREE, FREE, OBSTACLE, UNKNOWN]), np.array([FREE, OBSTACLE, FREE, FREE])
    assert free_space_overlap(one, other) == 0.25
