"""When a simulated robot counts as lost."""

import numpy as np
import pytest

from drake_ispace.room.room import Space
from drake_ispace.simulation import first_divergence

ROOM = Space(width_m=2.5, depth_m=2.0)


def path(**changed):
    """Ten poses in the middle of the room; the seventh is changed."""
    rows = np.zeros((10, 3))
    for column, value in changed.items():
        rows[6, ("x", "y", "phi").index(column)] = value
    return {"omni_pose": rows}


@pytest.mark.parametrize("changed", [{"x": 1.26}, {"x": -1.26}, {"y": 1.01}, {"y": np.nan}])
def test_a_robot_outside_of_the_room_is_lost(changed):
    assert first_divergence(path(**changed), ROOM) == 6


@pytest.mark.parametrize("changed", [{}, {"x": 1.24, "y": -0.99}, {"phi": 30.0}])
def test_a_robot_in_the_room_is_not_lost(changed):
    assert first_divergence(path(**changed), ROOM) is None


def test_the_room_is_that_of_the_scenario():
    assert first_divergence(path(x=2.9), Space(width_m=6.0, depth_m=6.0)) is None
