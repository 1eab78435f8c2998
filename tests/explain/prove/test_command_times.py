"""What unknown moments of a command's changes do to free runs, against many draws of them."""

from types import SimpleNamespace

import numpy as np
import pytest

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.prove.noise.command_times import left_by_command_times

STEP_TICKS, HORIZON_S = 20, 5.0


def moved(command):
    """(rows, 3) x, y, heading of a robot that follows the command (rows, 3) at once."""
    heading = np.cumsum(command[:, 2]) * TICK_S
    c, s = np.cos(heading), np.sin(heading)
    x, y = c * command[:, 0] - s * command[:, 1], s * command[:, 0] + c * command[:, 1]
    return np.column_stack([np.cumsum(x) * TICK_S, np.cumsum(y) * TICK_S, heading])


def drawn(random, changes, levels, rows):
    """(rows, 3) the command, each change up to a step before it was logged, by half a step in the mean."""
    at = changes + STEP_TICKS // 2 - random.integers(0, STEP_TICKS, len(changes))
    return levels[np.searchsorted(at, np.arange(rows), side="right")]


def test_it_is_what_draws_of_the_moments_leave():
    random, rows = np.random.default_rng(3), round(HORIZON_S / TICK_S)
    errors, tracks = [], []
    for _ in range(600):
        changes = np.sort(random.choice(np.arange(2 * STEP_TICKS, rows, 2 * STEP_TICKS), 5, replace=False))
        levels = np.column_stack([random.uniform(0.1, 0.4, 6), np.zeros(6), random.uniform(-0.3, 0.3, 6)])
        logged = levels[np.searchsorted(changes, np.arange(rows), side="right")]
        tracks.append(SimpleNamespace(command=logged, ticks=rows, command_step_s=STEP_TICKS * TICK_S))
        errors.append((moved(drawn(random, changes, levels, rows)) - moved(logged))[-1])
    x, y, heading = np.sqrt(np.mean(np.square(errors), axis=0))
    left = left_by_command_times(tracks, HORIZON_S)
    assert left["heading"] == pytest.approx(heading, rel=0.1)
    assert left["position"] == pytest.approx(np.hypot(x, y), rel=0.15)


def test_a_command_that_does_not_change_leaves_nothing():
    track = SimpleNamespace(command=np.full((100, 3), 0.2), ticks=100, command_step_s=0.1)
    assert left_by_command_times([track], 1.0) == {"position": 0.0, "heading": 0.0}
