"""The camera's place from points on the floor."""

import cv2
import numpy as np
import pytest

from drake_ispace.blocks.errors import InputError
from drake_ispace.files.yaml_guard import dump_yaml
from drake_ispace.room.room import Camera
from drake_ispace.scenario import load_scenario
from drake_ispace.vision.calibration import board_points, calibrate, read_points
from drake_ispace.vision.camera import view_of
from drake_ispace.vision.top_view import CORNERS, trapezoid

CORNER_POINTS = CORNERS * [2.5, 2.0]
MOVED = Camera(height_m=3.1, roll_rad=-0.08, pitch_rad=1.1, foot_m=[0.2, -1.4], foot_yaw_rad=0.8)


def seen(camera, places):
    """u, v, x, y of places on the floor."""
    return np.hstack([view_of(camera).project(np.column_stack([places, np.zeros(len(places))])), places])


@pytest.mark.parametrize("camera", [Camera(), MOVED])
def test_four_corners_give_the_camera_back(camera):
    found = calibrate(seen(camera, CORNER_POINTS), Camera()).camera
    for name in ("height_m", "roll_rad", "pitch_rad", "yaw_rad", "foot_m", "foot_yaw_rad"):
        assert getattr(found, name) == pytest.approx(getattr(camera, name), abs=1e-4), name


def test_more_points_average_what_a_click_is_off():
    rng = np.random.default_rng(0)
    points = seen(MOVED, rng.uniform([-1.2, -0.9], [1.2, 0.9], (30, 2)))
    points[:, :2] += rng.normal(0.0, 0.5, (30, 2))
    result = calibrate(points, Camera())
    assert result.camera.height_m == pytest.approx(3.1, abs=0.02)
    assert result.camera.foot_m == pytest.approx([0.2, -1.4], abs=0.02)
    assert 0.2 < np.sqrt((result.residual_pixels**2).mean()) < 1.2


def test_the_focal_length_can_be_found_too():
    camera = Camera(focal_pixels=[480.0, 480.0])
    points = seen(camera, np.random.default_rng(1).uniform([-1.0, -0.8], [1.0, 0.8], (12, 2)))
    found = calibrate(points, Camera(), fit_focal=True).camera
    assert found.focal_pixels == pytest.approx([480.0, 480.0], rel=1e-3)
    assert found.height_m == pytest.approx(2.78, abs=0.01)


def test_a_bent_lens_is_taken_into_account():
    camera = Camera(distortion=[-0.1, 0.02, 0.0, 0.0, 0.0])
    assert calibrate(seen(camera, CORNER_POINTS), camera).camera.height_m == pytest.approx(2.78, abs=1e-3)


def test_the_section_is_a_scenarios_camera(tmp_path):
    file = tmp_path / "camera.yaml"
    file.write_text(dump_yaml({"space": calibrate(seen(MOVED, CORNER_POINTS), Camera()).to_data()}))
    found = load_scenario(str(file)).space.camera
    assert trapezoid(view_of(found), 2.5, 2.0) == pytest.approx(trapezoid(view_of(MOVED), 2.5, 2.0), abs=0.01)


def test_four_pixels_are_the_corners_of_the_space():
    points = read_points(["1,2", "3,4", "5,6", "7,8"], 2.5, 2.0)
    assert points[0].tolist() == [1.0, 2.0, -1.25, 1.0] and points[2].tolist() == [5.0, 6.0, 1.25, -1.0]


def chessboard(view, columns, rows, square, x, y, yaw):
    """What a View sees of a chessboard on a grey floor."""
    cells = 20  # pixels a square
    u, v = np.meshgrid(*(np.arange((n + 3) * cells) // cells for n in (columns, rows)))
    inside = (u > 0) & (u < columns + 2) & (v > 0) & (v < rows + 2)
    flat = np.where(inside & ((u + v) % 2 == 0), 30, 230).astype(np.uint8)
    c, s = np.cos(yaw), np.sin(yaw)
    along, across = ((np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * [columns + 3, rows + 3] - 2.0) * square).T
    floor = np.column_stack([x + c * along + s * across, y + s * along - c * across, np.zeros(4)])
    corners = np.array([[0, 0], [flat.shape[1], 0], flat.shape[::-1], [0, flat.shape[0]]]) - 0.5
    warp = cv2.getPerspectiveTransform(corners.astype(np.float32), view.project(floor).astype(np.float32))
    image = cv2.warpPerspective(flat, warp, view.size, flags=cv2.INTER_AREA, borderValue=128)
    return cv2.merge([cv2.GaussianBlur(image, (0, 0), 0.7)] * 3)


@pytest.mark.parametrize("yaw", [0.2, 1.8, -2.5])
def test_a_chessboard_is_found_the_right_way_round(yaw):
    board = (7, 6, 0.12, -0.1, 0.2, yaw)
    points = board_points(chessboard(view_of(MOVED), *board), ",".join(map(str, board)))
    assert len(points) == 42
    assert points[:, :2] == pytest.approx(seen(MOVED, points[:, 2:])[:, :2], abs=0.8)
    assert calibrate(points, Camera()).camera.foot_m == pytest.approx(MOVED.foot_m, abs=0.03)


def test_without_a_chessboard_there_is_a_sentence():
    with pytest.raises(InputError, match="no chessboard of 7 x 6 inner corners is seen"):
        board_points(np.zeros((480, 640, 3), np.uint8), "7,6,0.1,0,0,0")


@pytest.mark.parametrize(
    "text", ["", "7,6", "7,7,0.1,0,0,0", "7,6,0,0,0,0", "7.5,6,0.1,0,0,0", "2,3,0.1,0,0,0", "a,6,1,0,0,0"]
)
def test_bad_boards_are_refused(text):
    with pytest.raises(InputError, match="--board: expected columns,rows"):
        board_points(np.zeros((480, 640, 3), np.uint8), text)


@pytest.mark.parametrize(
    "texts, message",
    [
        (["1,2,3"], "expected u,v,x,y"),
        (["1,a"], "expected u,v,x,y"),
        (["nan,1"], "expected u,v,x,y"),
        (["1,2"] * 3, "got 3"),
        (["1,2", "1,2,3,4"], "of every point"),
        (["1,2,3,4"] * 3, "at least four points, got 3"),
        ([], "at least four points, got 0"),
    ],
)
def test_bad_points_are_refused(texts, message):
    with pytest.raises(InputError, match=message):
        read_points(texts, 2.5, 2.0)


@pytest.mark.parametrize("points", [
    [[0.0, 0.0, 0.0, 0.0], [100.0, 0.0, 1.0, 0.0], [200.0, 0.0, 2.0, 0.0], [300.0, 0.0, 3.0, 0.0]],
    [[5.0, 5.0, -1.0, 1.0], [5.0, 5.0, 1.0, 1.0], [5.0, 5.0, 1.0, -1.0], [5.0, 5.0, -1.0, -1.0]],
    [[100.0, 100.0, 1.0, 1.0], [500.0, 100.0, -1.0, 1.0], [500.0, 400.0, -1.0, -1.0], [100.0, 400.0, 1.0, -1.0]],
    [[100.0, 100.0, -1.0, 1.0], [500.0, 400.0, 1.0, 1.0], [500.0, 100.0, 1.0, -1.0], [100.0, 400.0, -1.0, -1.0]],
], ids=["on a line", "one pixel", "mirrored", "crossed"])
def test_points_that_fix_no_camera_are_refused(points):
    with pytest.raises(InputError, match="--points: "):
        calibrate(points, Camera())
