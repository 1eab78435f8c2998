"""The camera's geometry: Table 5.1, (5.1)-(5.6), and its place above the space."""

import numpy as np
import pytest
from camera_geometry import printed_vectors, to_plane

from drake_ispace.blocks.errors import InputError
from drake_ispace.room.room import Camera, Space
from drake_ispace.vision.optics.camera import (
    camera_matrix,
    rotation_gs,
    rotation_z,
    view_of,
)
from drake_ispace.vision.optics.top_view import trapezoid

VIEW = view_of(Camera())
GRID = VIEW.pixel_grid()[::1301]


def on_floor(places, height=0.0):
    return np.column_stack([places, np.full(len(places), height)])


def test_focal_lengths_follow_from_the_view_angles_of_table_5_1():
    matrix = camera_matrix(Camera())
    assert (matrix[0, 0], matrix[1, 1]) == pytest.approx((320.0 / np.tan(0.4974), 240.0 / np.tan(0.37525)))
    assert (matrix[0, 0], matrix[1, 1]) == pytest.approx((589.4, 609.3), abs=0.05)


def test_the_view_meets_the_floor_one_metre_ahead():
    camera = Camera()
    ahead = rotation_gs(camera.roll_rad, camera.pitch_rad, camera.yaw_rad)[:, 0]
    centre = camera.height_m / -ahead[2] * ahead[:2]
    assert np.hypot(*centre) == pytest.approx(2.78 / np.tan(1.223)) == pytest.approx(1.008, abs=1e-3)
    assert np.arctan2(centre[1], centre[0]) == pytest.approx(0.5)


def test_5_1_by_hand():
    # pitch alone turns the view down, yaw to the left, roll lifts the left side of the picture's horizon
    assert rotation_gs(0.0, np.pi / 2.0, 0.0)[:, 0] == pytest.approx([0.0, 0.0, -1.0])
    assert rotation_gs(0.0, 0.0, np.pi / 2.0)[:, 0] == pytest.approx([0.0, 1.0, 0.0])
    assert rotation_gs(0.1, 0.0, 0.0)[:, 1] == pytest.approx([0.0, np.cos(0.1), np.sin(0.1)])


def test_the_camera_looks_along_the_depth_of_the_space():
    ahead = VIEW.r_ws[:, 0]
    assert ahead[0] == pytest.approx(0.0, abs=1e-12) and ahead[1] > 0.0 > ahead[2]


@pytest.mark.parametrize("height", [0.0, 0.15, 0.3])
def test_the_whole_space_lies_in_the_picture_up_to_the_highest_markers(height):
    corners = trapezoid(VIEW, 2.5, 2.0, height)
    assert (corners > 2.0).all() and (corners < np.array([637.0, 477.0])).all()


def test_the_space_would_not_fit_across_the_view():
    assert not ((trapezoid(VIEW, 2.0, 2.5, 0.3) > 0.0) & (trapezoid(VIEW, 2.0, 2.5, 0.3) < [640.0, 480.0])).all()


@pytest.mark.parametrize("distortion", [[0.0] * 5, [-0.12, 0.05, 1e-3, -5e-4, 0.0]])
@pytest.mark.parametrize("height", [0.0, 0.3])
def test_projection_undoes_the_way_to_the_floor(distortion, height):
    view = view_of(Camera(distortion=distortion))
    places = to_plane(view, GRID, height)
    assert view.project(on_floor(places, height)) == pytest.approx(GRID, abs=2e-2 if any(distortion) else 1e-9)


def test_a_ray_times_depth_along_the_view_is_the_point():
    places = to_plane(VIEW, GRID)
    depth = (on_floor(places) - VIEW.p_ws) @ VIEW.r_ws[:, 0]
    assert VIEW.p_ws + depth[:, None] * VIEW.rays(GRID) == pytest.approx(on_floor(places), abs=1e-12)


def test_rays_above_the_horizon_meet_no_floor():
    level = view_of(Camera(pitch_rad=0.2, roll_rad=0.0))
    assert np.isnan(to_plane(level, [[319.5, 0.0]])).all() and np.isfinite(to_plane(level, [[319.5, 479.0]])).all()


def test_what_lies_behind_the_camera_has_no_pixel():
    assert np.isnan(VIEW.project([[0.0, 0.0, 5.0]])).all()


def printed_error(pixel, **variant):
    """How far on the floor (5.3)-(5.6) as printed miss what the pixel sees [m]."""
    camera = Camera()
    place = to_plane(VIEW, [pixel])[0]
    distance = np.linalg.norm([*place, 0.0] - VIEW.p_ws)
    d = rotation_z(camera.foot_yaw_rad) @ printed_vectors(camera, [pixel], [distance], **variant)[0]
    return np.hypot(*(VIEW.p_ws[:2] + VIEW.p_ws[2] / -d[2] * d[:2] - place))


def test_the_printed_form_holds_in_the_middle_of_the_picture():
    assert printed_error([319.5, 239.5]) < 1e-9


@pytest.mark.parametrize("u, error_m", [(159.5, 0.56), (-0.5, 1.16)])
def test_the_printed_form_misses_the_floor_beside_the_middle(u, error_m):
    assert printed_error([u, 239.5]) == pytest.approx(error_m, abs=0.01)


def test_5_4_starts_from_the_wrong_angle():
    assert printed_error([319.5, 239.5], yaw_from_pitch=True) == pytest.approx(0.71, abs=0.01)


def test_roll_does_nothing_in_the_printed_form_and_shifts_the_edge_in_truth():
    pixels, distance = [[320.0, 60.0], [600.0, 240.0]], [3.0, 3.0]
    level = Camera(roll_rad=0.0)
    assert printed_vectors(Camera(), pixels, distance) == pytest.approx(printed_vectors(level, pixels, distance))
    moved = to_plane(VIEW, [[639.5, 239.5]]) - to_plane(view_of(level), [[639.5, 239.5]])
    assert 0.05 < np.hypot(*moved[0]) < 0.15


def test_a_camera_that_looks_up_is_refused():
    with pytest.raises(InputError, match="does not look down"):
        view_of(Camera(pitch_rad=-0.3))


def test_the_middle_of_the_space_is_its_origin():
    corners = to_plane(VIEW, trapezoid(VIEW, Space().width_m, Space().depth_m))
    assert corners.mean(axis=0) == pytest.approx([0.0, 0.0], abs=1e-9)
