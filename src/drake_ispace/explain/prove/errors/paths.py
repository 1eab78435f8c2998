"""Errors of paths as the field computes them (evo, rpg_trajectory_evaluation): ATE without alignment, and RPE.

A pose is a row x, y [m], phi [rad]. Absolute trajectory error (ATE): the pose of the model seen from the measured pose
at the same time. Relative pose error (RPE): the model's motion over a while, seen from the measured motion.
"""

import numpy as np

from drake_ispace.blocks.frames import rotated, wrap


def compose(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(k, 3) the poses `b`, given in the frames `a`; one of the two may be a single pose (3,)."""
    a, b = np.atleast_2d(a), np.atleast_2d(b)
    return np.column_stack([a[:, :2] + rotated(b[:, :2], a[:, 2]), wrap(a[:, 2] + b[:, 2])])


def relative(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(k, 3) the poses `b` as seen from the frames `a`, both in W; one of the two may be a single pose (3,)."""
    a, b = np.atleast_2d(a), np.atleast_2d(b)
    return np.column_stack([rotated(b[:, :2] - a[:, :2], -a[:, 2]), wrap(b[:, 2] - a[:, 2])])


def aligned(model: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """(3,) the pose S for which S composed with the model's poses (k, 3) comes nearest to the measured ones (k, 3)."""
    turn = wrap(measured[:, 2] - model[:, 2])
    phi = np.arctan2(np.sin(turn).mean(), np.cos(turn).mean())
    turned = compose(np.array([0.0, 0.0, phi]), model)
    return np.array([*(measured[:, :2] - turned[:, :2]).mean(axis=0), phi])


def absolute_errors(model: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """(k, 3) the model's poses (k, 3) as seen from the measured ones (k, 3)."""
    return relative(measured, model)


def relative_errors(
    model: tuple[np.ndarray, np.ndarray], measured: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """(k, 3) the model's motions as seen from the measured ones; each is (poses before (k, 3), poses after (k, 3))."""
    return relative(relative(*measured), relative(*model))


def chained(start: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """(1 + k, 3) the poses that motions (k, 3), each in the frame of the pose before it, lead to from `start` (3,)."""
    phi = start[2] + np.concatenate([[0.0], np.cumsum(steps[:, 2])])
    places = np.cumsum(rotated(steps[:, :2], phi[:-1]), axis=0)
    return np.column_stack([start[:2] + np.vstack([np.zeros(2), places]), wrap(phi)])


def pairs(times_s: np.ndarray, horizon_s: float, spacing_s: float) -> np.ndarray:
    """(k, 2) numbers of the samples that are a horizon apart, a pair every `spacing_s` at most.

    The two samples of a pair are as far apart as the horizon within half of the median period of the samples.
    """
    if len(times_s) < 2:
        return np.empty((0, 2), int)
    reach = 0.5 * float(np.median(np.diff(times_s))) + 1e-9
    chosen, free_from = [], -np.inf
    for i, t in enumerate(times_s):
        if t < free_from:
            continue
        j = int(np.argmin(np.abs(times_s - t - horizon_s)))
        if j > i and abs(times_s[j] - t - horizon_s) <= reach:
            chosen.append((i, j))
            free_from = t + spacing_s - 1e-9
    return np.array(chosen, int).reshape(-1, 2)
