"""Paths: their lengths, curvature, nearest places, and the order of places on a path that goes round."""

import numpy as np
import pytest

from drake_ispace.blocks.errors import InputError
from drake_ispace.control.guide.paths import Trajectory, build_path, check_inside


def path(**keywords):
    return build_path(Trajectory(**keywords), "omni.trajectory")


@pytest.mark.parametrize("keywords, length, closed", [
    ({"kind": "step"}, 0.0, False),
    ({"kind": "pulse"}, 0.0, False),
    ({"kind": "line", "goal_m": [0.3, 0.4]}, 0.5, False),
    ({"kind": "square", "side_m": 1.2}, 4.8, True),
    ({"kind": "circle", "radius_m": 0.6}, 2.0 * np.pi * 0.6, True),
    ({"kind": "polyline", "points_m": [[0, 0], [0, 1], [2, 1]]}, 3.0, False),
    ({"kind": "polyline", "points_m": [[0, 0], [0, 3], [4, 0], [0, 0]]}, 12.0, True),
])
def test_length_and_whether_it_closes(keywords, length, closed):
    built = path(**keywords)
    assert built.length_m == pytest.approx(length, rel=1e-5)
    assert built.closed == closed


def test_a_circle_has_curvature_one_over_r():
    assert path(kind="circle", radius_m=0.5).table[:, 5] == pytest.approx(np.full(721, 2.0), rel=1e-5)


def test_a_figure_eight_is_four_radii_long_and_two_wide_and_turns_both_ways():
    built = path(kind="figure_eight", radius_m=0.3)
    assert np.ptp(built.points_m, axis=0) == pytest.approx([1.2, 0.6], abs=1e-4)
    assert built.table[:, 5].max() == pytest.approx(-built.table[:, 5].min(), rel=1e-6)


def test_tangents_are_unit_vectors_along_the_path():
    for kind in ("square", "circle", "figure_eight"):
        built = path(kind=kind)
        assert np.linalg.norm(built.table[:, 3:5], axis=1) == pytest.approx(np.ones(len(built.table)))
        chords = np.diff(built.points_m, axis=0)
        assert (np.sum(chords * built.table[:-1, 3:5], axis=1) >= 0.0).all()


def test_distance_and_place_of_the_nearest_point():
    gaps, arcs = path().nearest(np.array([[0.0, -0.7], [0.7, 0.0], [0.0, 0.0], [-0.6, -0.6]]))
    assert gaps == pytest.approx([0.1, 0.1, 0.6, 0.0])
    assert arcs[:2] == pytest.approx([0.6, 1.8])


def test_the_nearest_place_of_a_step_is_its_goal():
    gaps, arcs = path(kind="step", goal_m=[1.0, 0.0]).nearest(np.array([[1.0, 0.5]]))
    assert (gaps[0], arcs[0]) == (0.5, 0.0)


def test_progress_at_a_crossing_keeps_to_the_branch_it_is_on():
    built = path(kind="figure_eight")
    half = built.length_m / 2.0
    assert built.progress(np.array([0.0, 0.0]), 0.05) == pytest.approx(-0.05, abs=1e-3)
    assert built.progress(np.array([0.0, 0.0]), half - 0.05) == pytest.approx(0.05, abs=1e-3)


def test_progress_over_the_seam_of_a_closed_path():
    assert path().progress(np.array([-0.5, -0.6]), 4.75) == pytest.approx(0.15)


def test_a_way_point_outside_of_the_space_is_refused():
    with pytest.raises(InputError, match=r"omni.trajectory: way point \(-1.5, -1.5\) m lies outside of the 2.5 x 2 m"):
        check_inside(path(side_m=3.0), 2.5, 2.0, "omni.trajectory")
    check_inside(path(side_m=2.0), 2.5, 2.0, "omni.trajectory")
