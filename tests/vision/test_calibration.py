"""The camera's place from points on the floor."""

import dataclasses

import cv2
import numpy as np
import pytest

from drake_ispace.blocks.errors import InputError
from drake_ispace.files.yaml_guard import dump_yaml
from drake_ispace.room.room import Camera
from drake_ispace.scenario import load_scenario
from drake_ispace.vision.optics.calibration import board_points, calibrate, read_points
from drake_ispace.vision.optics.camera import view_of
from drake_ispace.vision.optics.top_view import CORNERS, trapezoid

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


def spread(camera, count, seed=0, noise=0.3, reach=(1.1, 0.85)):
    """So many clicked points on the floor, each off by some `noise` pixels."""
    random = np.random.default_rng(seed)
    edge = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * reach
    places = np.vstack([edge, random.uniform(-1.0, 1.0, (max(count - 4, 0), 2)) * reach])[:count]
    points = seen(camera, places)
    points[:, :2] += random.normal(0.0, noise, (count, 2))
    return points


BENT = Camera(distortion=[0.108, 0.0, 0.0, 0.0, 0.0])  # 5 % at the corners of the picture


def test_lens_focal_length_and_height_are_found_together():
    camera = dataclasses.replace(BENT, focal_pixels=[520.0, 520.0])
    found = calibrate(spread(camera, 40), Camera(), fit_focal=True, fit_lens=True).camera
    places = np.random.default_rng(9).uniform([-1.1, -0.85], [1.1, 0.85], (200, 2))
    assert seen(found, places)[:, :2] == pytest.approx(seen(camera, places)[:, :2], abs=1.0)
    assert np.sqrt(np.mean((seen(found, places) - seen(camera, places))[:, :2] ** 2)) < 0.5
    assert found.height_m == pytest.approx(2.78, abs=0.03)


def bent(image, camera):
    """What a bent lens makes of a picture that was taken by a straight one."""
    view = view_of(camera)
    pixels = view.pixel_grid().astype(np.float32)
    straight = cv2.undistortPoints(pixels[:, None], view.matrix, view.distortion, P=view.matrix)
    grid = straight.reshape(*image.shape[:2], 2).astype(np.float32)
    return cv2.remap(image, grid, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)


def test_a_rendered_board_shows_the_lens():
    board = (11, 8, 0.18, -0.9, 0.65, 0.0)
    points = board_points(bent(chessboard(view_of(Camera()), *board), BENT), ",".join(map(str, board)))
    found = calibrate(points, Camera(), fit_lens=True)
    error, straight = (np.sqrt(np.mean(c.residual_pixels**2)) for c in (found, calibrate(points, Camera())))
    assert error < 0.5 and error < 0.5 * straight
    assert found.camera.distortion[0] == pytest.approx(0.108, abs=0.02)


def swapped(points):
    points[[0, 2], :2] = points[[2, 0], :2]
    return points


def mirrored(points):
    points[:, 2] *= -1.0
    return points


def exchanged(points):
    points[:, [2, 3]] = points[:, [3, 2]]
    return points


def slipped(points, by=30.0):
    points[1, 0] += by
    return points


def on_a_line(points, off_m=0.0):
    places = np.column_stack([np.linspace(-1.0, 1.0, len(points)), off_m * (-1.0) ** np.arange(len(points))])
    return seen(Camera(), places)


LONG, ABOVE = Camera(focal_pixels=[900.0, 900.0]), Camera(pitch_rad=1.5607, roll_rad=0.0, foot_m=[0.0, 0.0])


@pytest.mark.parametrize("points, options", [
    *((swapped(spread(Camera(), n)), {}) for n in (4, 6, 9)),
    *((mirrored(spread(Camera(), n)), {}) for n in (4, 6, 9)),
    *((exchanged(spread(Camera(), n)), {}) for n in (4, 6)),
    *((slipped(spread(Camera(), n)), {}) for n in (4, 5, 6, 9, 12)),
    (slipped(spread(Camera(), 6), -30.0), {}),
    pytest.param(slipped(spread(Camera(), 9)), {"fit_focal": True}, marks=pytest.mark.slow),
    *((on_a_line(np.zeros((n, 4))), {}) for n in (4, 8)), (on_a_line(np.zeros((6, 4)), 2e-4), {}),
    (spread(LONG, 6, reach=(0.5, 0.4)), {}),
    pytest.param(spread(ABOVE, 8), {"fit_focal": True}, marks=pytest.mark.slow),
    (spread(Camera(), 4), {"fit_focal": True}),
    (spread(BENT, 8, reach=(0.1, 0.1)), {"fit_lens": True}), (spread(BENT, 4), {"fit_lens": True}),
])
def test_a_bad_calibration_is_refused(points, options):
    with pytest.raises(InputError, match=r"^--(points|fit-focal|fit-lens): .*expected"):
        calibrate(points, Camera(), **options)


@pytest.mark.parametrize("count", [6, 9, 12])
def test_the_click_that_slipped_is_named(count):
    points = slipped(spread(Camera(), count))
    u, v = points[1, :2]
    with pytest.raises(InputError, match=f"the point {u:g},{v:g} at .* does not go with the others"):
        calibrate(points, Camera())
