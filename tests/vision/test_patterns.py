"""Patterns of markers laid on blobs: which blobs make a robot, and what tells nothing."""

import numpy as np
import pytest

from drake_ispace.vision.finding.markers import Blob
from drake_ispace.vision.finding.patterns import Marker, Pattern, matches, pair, told_apart

AREA = (0.003, 0.005)
PAIR = pair("red", "blue", 0.10, 0.012, AREA)
TRIPLE = Pattern((
    Marker("blue", 0.055, 0.0, AREA), Marker("red", -0.05, 0.05, AREA), Marker("green", -0.05, -0.05, AREA),
), 0.012)
MIRRORED = Pattern((
    Marker("blue", 0.055, 0.0, AREA), Marker("green", -0.05, 0.05, AREA), Marker("red", -0.05, -0.05, AREA),
), 0.012)


def blob(x, y, area=0.004, elongation=1.0):
    return Blob(np.zeros(2), np.array([x, y]), area, elongation)


def blobs_of(*robots, noise_m=0.0, seed=0):
    """colour -> blobs of robots, each a pattern and a pose."""
    rng, found = np.random.default_rng(seed), {"red": [], "blue": [], "green": []}
    for pattern, (x, y, phi) in robots:
        turn = np.array([[np.cos(phi), -np.sin(phi)], [np.sin(phi), np.cos(phi)]])
        for marker in pattern.markers:
            place = turn @ [marker.x_m, marker.y_m] + [x, y] + rng.normal(0.0, noise_m, 2)
            found[marker.colour].append(blob(*place))
    return found


def poses(pattern, found):
    return [match.pose for match in told_apart(matches(pattern, found))]


@pytest.mark.parametrize("pattern", [PAIR, TRIPLE])
@pytest.mark.parametrize("pose", [(0.3, -0.2, 0.5), (-1.0, 0.4, -2.8)])
def test_a_pattern_is_found_where_it_stands(pattern, pose):
    (found,) = poses(pattern, blobs_of((pattern, pose)))
    assert found == pytest.approx(pose, abs=1e-12)


def test_noise_within_the_tolerance_moves_the_pose_by_no_more():
    (found,) = poses(TRIPLE, blobs_of((TRIPLE, (0.3, -0.2, 0.5)), noise_m=0.001))
    assert found[:2] == pytest.approx([0.3, -0.2], abs=0.003) and found[2] == pytest.approx(0.5, abs=0.05)


def test_a_mirrored_pattern_is_another_one():
    found = blobs_of((TRIPLE, (0.3, -0.2, 0.5)))
    assert not matches(MIRRORED, found) and matches(TRIPLE, found)


@pytest.mark.parametrize("change", [{"area": 0.0029}, {"area": 0.0051}, {"elongation": 1.2}])
def test_a_blob_of_another_size_or_shape_is_no_marker(change):
    found = {"red": [blob(0.05, 0.0)], "blue": [blob(-0.05, 0.0, **change)]}
    assert not matches(PAIR, found)


def test_markers_too_far_apart_are_no_robot():
    found = [matches(PAIR, {"red": [blob(gap, 0)], "blue": [blob(0, 0)]}) for gap in (0.087, 0.089, 0.111, 0.113)]
    assert list(map(bool, found)) == [False, True, True, False]


def test_a_blob_that_two_robots_could_share_tells_nothing():
    found = {"red": [blob(0.0, 0.0)], "blue": [blob(0.1, 0.0), blob(-0.1, 0.0)]}
    assert len(matches(PAIR, found)) == 2 and poses(PAIR, found) == []


def test_a_row_of_robots_is_told_apart_by_what_explains_all_markers():
    # red blue | red blue | red blue, each 0.1 m from the next: the gaps between robots would be robots as well
    row = blobs_of(*((PAIR, (0.2 * i, 0.0, np.pi)) for i in range(3)))
    assert len(matches(PAIR, row)) == 5
    assert sorted(x for x, _, _ in poses(PAIR, row)) == pytest.approx([0.0, 0.2, 0.4])


def test_four_robots_of_equal_patterns_are_all_found():
    places = [(0.0, 0.0, 0.1), (0.5, 0.1, 2.0), (-0.4, 0.3, -1.0), (0.2, -0.6, 3.0)]
    found = poses(TRIPLE, blobs_of(*((TRIPLE, place) for place in places)))
    np.testing.assert_allclose(sorted(found), sorted(places), atol=1e-12)


def test_of_a_heap_of_markers_none_is_told_apart():
    rng = np.random.default_rng(0)
    heap = {colour: [blob(*rng.uniform(-0.1, 0.1, 2)) for _ in range(30)] for colour in ("red", "blue")}
    assert len(matches(PAIR, heap)) > 20 and poses(PAIR, heap) == []


def test_a_pattern_that_looks_the_same_when_turned_is_known_as_such():
    same = pair("red", "red", 0.1, 0.012, AREA)
    assert same.part_of(same) and not PAIR.part_of(PAIR) and not TRIPLE.part_of(TRIPLE)


def test_a_pair_may_be_part_of_a_larger_pattern():
    front = Pattern((Marker("blue", 0.0, 0.0, AREA), Marker("red", -0.105, 0.05, AREA)), 0.012)
    assert front.part_of(TRIPLE) and not PAIR.part_of(TRIPLE) and not TRIPLE.part_of(MIRRORED)
