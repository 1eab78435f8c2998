"""Free-run errors of a run, or of a part of it, that begins in motion."""

from types import SimpleNamespace

import numpy as np

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.fit.free_run import Sizes, errors_from_nearest, measured


def test_a_fall_begins_where_it_comes_nearest_however_fast_it_grows():
    """10 per second: what the start is off by grows 20 000 times in a second, far beyond where that is linear."""
    count = 1e-3

    def simulated(track, values, plant, start):
        angles, (angle, rate) = np.empty((track.ticks + 1, 1)), start
        for i in range(track.ticks + 1):
            angles[i] = angle
            rate += 100.0 * np.sin(angle) * TICK_S
            angle += rate * TICK_S
        return angles

    track = SimpleNamespace(ticks=200, unscored_ticks=1, command=np.zeros((200, 1)))
    track.measured = count * np.round(simulated(track, {}, None, (2e-4, 1e-3)) / count)
    assert 1.0 < track.measured[-1] < 6.0
    errors = errors_from_nearest(SimpleNamespace(logged="angle", simulated=simulated), track, Sizes({}, {}))
    assert np.sqrt(np.mean(errors**2)) < count


def test_a_part_that_begins_in_motion_is_compared_from_its_begin():
    """A robot that coasts until a last torque."""
    command = np.zeros((200, 1))
    command[-1] = 1.0
    track = SimpleNamespace(ticks=200, unscored_ticks=1, command=command, measured=0.01 * np.arange(201.0)[:, None])
    assert len(measured(SimpleNamespace(logged="speed"), track)) == 199
