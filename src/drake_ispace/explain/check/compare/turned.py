"""By which angles the ways that a camera sees are turned against those of the wheels, in most runs and in others.

Besides, a marker that is not at the middle goes along with the turns. It is mounted alike in all runs.
"""

from collections.abc import Sequence

import numpy as np

from drake_ispace.blocks.frames import wrap
from drake_ispace.explain.check.compare.regression import SLACK
from drake_ispace.explain.levels import CERTAIN

Motions = tuple[np.ndarray, np.ndarray]  # (n, 3) of windows, as wheels and as camera say


def turns(motions: Sequence[Motions]) -> list[float]:
    """Angles [rad], that of most runs first, then of each run that differs plainly; motions: of each run.

    Of two runs that differ, the one whose camera is turned less stands for most.
    """
    runs = [_complex(*both) for both in motions]
    alike = _alike([_fitted(known, seen) for known, seen in runs])
    most = [one for one, is_alike in zip(runs, alike, strict=True) if is_alike] or runs
    shares, _ = _fitted(*map(np.concatenate, zip(*most, strict=True)))
    usual = float(np.angle(shares[0]))
    beside = [float(np.angle(np.vdot(known @ shares, seen))) for known, seen in runs]
    return [usual, *(float(wrap(usual + angle)) for angle in beside if abs(angle) > SLACK and alike.any())]


def _complex(wheels, camera):
    """(n, 2) ways and turns of the wheels, and (n,) ways that the camera sees, as complex numbers."""
    known = np.column_stack([wheels[:, 0] + 1j * wheels[:, 1], 1j * wheels[:, 2]])
    return known, camera[:, 0] + 1j * camera[:, 1]


def _fitted(known, seen):
    """(2,) shares of the wheels' motions in the way seen, and how uncertain the angle of the first one is [rad].

    On a steady circle ways and turns are alike, and nothing tells the angle.
    """
    shares, _, rank, _ = np.linalg.lstsq(known, seen, rcond=None)
    if rank < 2 or len(seen) < 3 or not shares[0]:
        return shares, np.inf
    noise = np.sum(np.abs(seen - known @ shares) ** 2) / (len(seen) - 2)
    spread = noise * np.linalg.inv(known.conj().T @ known)[0, 0].real
    return shares, float(np.sqrt(0.5 * spread) / np.abs(shares[0]))


def _alike(fitted):
    """(runs,) which runs that tell their angle share it, as most do."""
    angles = np.array([np.angle(shares[0]) for shares, _ in fitted])
    tells = np.array([CERTAIN * unsure < SLACK for _, unsure in fitted])
    if not tells.any():
        return tells
    apart = np.abs(wrap(angles[:, None] - angles))
    best = min(np.flatnonzero(tells), key=lambda i: (apart[i, tells].sum(), abs(angles[i])))
    return tells & (apart[best] <= SLACK)
