"""How far a rover's room view trusts a fix: the gains under which its innovations are most likely.

Between two fixes odometry adds up its own errors, and a fix has its noise; the best gain follows from their ratio,
which differs by orders of magnitude between a ceiling of motion-capture cameras (0.2 mm) and a Kinect (20 mm). With too
large a gain every fix's noise is taken for motion, with too small a one old drift is counted again at every fix.
Innovations are then no longer independent, and short-lived disagreements outweigh what adds up over a whole run.
"""

import dataclasses

import numpy as np
from scipy.signal import lfilter

_HEADING = (0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.8)
_PLACE = (0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1.0)
_FEW = 20  # fixes, below which the gains stay as they are
_LEAST = 1e-12  # m^2, rad^2: spread of innovations that counts as none


def tuned(replay, tracks, starts):
    """The Replay with the likeliest gains for these runs, those of place and of heading one after the other."""
    if max(len(track.fix_t) for track in tracks) < _FEW:
        return replay
    for which, tried in ((1, _HEADING), (0, _PLACE)):
        found = [with_gain(replay, which, value) for value in tried]
        replay = min(found, key=lambda r: _deviance(r, tracks, starts))
    return replay


def with_gain(replay, which: int, value: float):
    """The Replay with another gain of place (0) or heading (1)."""
    numbers = replay.rollout.parameters.copy()
    numbers[replay.rollout.index(f"{replay.body.name}_view.gain[{which}]")] = value
    return dataclasses.replace(replay, rollout=dataclasses.replace(replay.rollout, parameters=numbers))


def _deviance(replay, tracks, starts):
    """Minus twice the log likelihood per row of Gaussian innovations, but for a constant.

    What goes with the motion itself (a share of the way, of the turning, a drift) is not noise and is taken away first,
    body axis by body axis; innovations at a small gain remember it, as far back as the gain does.
    """
    numbers = replay.parameters({})
    gains = [replay.rollout.parameters[replay.rollout.index(f"{replay.body.name}_view.gain[{i}]")] for i in (0, 1)]
    rows, causes = [], ([], [])
    for track, start in zip(tracks, starts, strict=True):
        if len(track.fix_t) < _FEW:
            continue
        pose = track.poses
        pose[:, 2] = np.unwrap(pose[:, 2])
        rows.append(_in_body(replay.run(track, start, numbers)[1][1:], pose[:-1, 2]))
        steps = np.column_stack([_in_body(np.diff(pose, axis=0), pose[:-1, 2]), np.diff(track.fix_t)])
        for gain, found in zip(gains, causes, strict=True):
            found.append(lfilter([1.0], [1.0, gain - 1.0], steps, axis=0))
    innovations = np.vstack(rows)
    for columns, own in zip(causes, ([0, 1], [2]), strict=True):
        cause = np.vstack(columns)
        innovations[:, own] -= cause @ np.linalg.lstsq(cause, innovations[:, own], rcond=None)[0]
    covariance = innovations.T @ innovations / len(innovations)
    return float(np.linalg.slogdet(covariance + _LEAST * np.eye(3))[1])


def _in_body(rows, headings):
    """(k, 3) with x, y turned from W into B."""
    c, s = np.cos(headings), np.sin(headings)
    return np.column_stack([c * rows[:, 0] + s * rows[:, 1], -s * rows[:, 0] + c * rows[:, 1], rows[:, 2]])
