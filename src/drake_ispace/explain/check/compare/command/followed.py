"""Do the wheels do as commanded? Columns that command nothing, and stretches in which the wheels do otherwise.

Wheels that do a share of what they are told obey a drive that is weak or limited. Wheels that do something else follow
another command than the one that was logged.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from drake_ispace.explain.check.compare.command.drive import Drive, Following, best_following
from drake_ispace.explain.check.compare.links import FEWEST, PLACES_AND_TURNS, Base, inside
from drake_ispace.explain.check.compare.motion import WINDOW_S, arm
from drake_ispace.explain.check.compare.regression import MOST_SLACK, SLACK, residuals
from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.check.sampling.samples import STUCK_S, repeats, stretches
from drake_ispace.explain.check.sampling.stamps import are_gaps
from drake_ispace.explain.check.steps import SHOWS_M
from drake_ispace.explain.levels import largest_by_chance
from drake_ispace.faults.repair import CutOut, Without
from drake_ispace.robots.robot import COMMAND


def followed_findings(drives: Mapping[int, tuple[Drive, Base]]) -> list[Finding]:
    """What the wheels do not do as commanded; drives: number of a run -> its command, and its wheels."""
    if not drives:
        return []
    step_s = float(np.median([drive.step_s for drive, _ in drives.values()]))
    follows = best_following([(drive, drive.held()) for drive, _ in drives.values()], step_s, -1.0)
    found = []
    for i, (drive, base) in drives.items():
        motions = _motions(drive, base, follows)
        if motions is None:
            continue
        dead = _dead(drive.command, motions)
        found += [Finding(runs=(i,), **one) for one in (dead or _otherwise(drive.command, motions))]
    return found


@dataclass(frozen=True)
class _Motions:
    """Motions (k, 3) of the body in overlapping windows [m]; turns as lengths.

    told: as the drive would carry them out. made: by the wheels. left: of `made`, what `told` does not explain, physics
    of plausible size included. noise: (3,) of `made`. apart: windows from one to the next that does not overlap it.
    """

    since_s: np.ndarray
    until_s: np.ndarray
    told: np.ndarray
    made: np.ndarray
    left: np.ndarray
    noise: np.ndarray
    apart: int

    def way_m(self, motions: np.ndarray) -> float:
        """How far motions (k, ...) go, all in all."""
        return float(np.abs(motions).sum() / self.apart)


def _motions(drive: Drive, base: Base, follows: Following) -> _Motions | None:
    """The motions of a run; None where too few windows are sound."""
    unit = np.array([1.0, 1.0, arm(base.geometry)])
    told = follows.gain * drive.predicted(drive.held(), follows.late_s, follows.lag_s)
    apart = max(1, round(WINDOW_S / float(np.median(np.diff(drive.edges)))))
    edges = np.arange(len(drive.edges) - apart)
    since, until = drive.edges[edges], drive.edges[edges + apart]
    kept = inside(base, since, until)
    if kept.sum() < FEWEST * apart:
        return None
    total = (np.vstack([np.zeros(turns.shape[1]), np.cumsum(turns, axis=0)]) for turns in (told, drive.turned))
    told, made = (((of[edges + apart] - of[edges]) @ base.geometry.forward.T * unit)[kept] for of in total)
    return _Motions(since[kept], until[kept], told, made, residuals(told, made), base.noise * unit, apart)


def _dead(command, motions):
    """Columns with one value only, while the robot moves along that axis farther than physics makes of the others."""
    least = SHOWS_M + SLACK * motions.way_m(np.linalg.norm(motions.told, axis=1))
    still = [
        name for axis, name in enumerate(command.columns)
        if np.ptp(command.column(name)) == 0.0 and motions.way_m(motions.left[:, axis]) > least
    ]
    if not still:
        return []
    values = ", ".join(f"{name} is always {command.column(name)[0]:.4g}" for name in still)
    return [{
        "fault": "channel_dead", "what": f"{values}, and the wheels do otherwise", "channel": COMMAND,
        "repairs": (Without(COMMAND),),
    }]


def _otherwise(command, motions):
    """Stretches in which wheels do more otherwise than as told, for longer than a drive is late."""
    unusual, far = (np.zeros((len(PLACES_AND_TURNS), len(motions.left)), bool) for _ in range(2))
    for k, group in enumerate(map(list, PLACES_AND_TURNS)):
        left, told, made = (np.linalg.norm(of[:, group], axis=1) for of in (motions.left, motions.told, motions.made))
        usual = largest_by_chance(len(left) // motions.apart, len(group)) * max(
            np.median(left), motions.noise[group].max()
        )
        unusual[k] = left > usual
        far[k] = unusual[k] & (left > MOST_SLACK * np.sqrt(np.mean(told**2))) & (left > np.maximum(told, made) - left)
    found, reached = [], -1
    for first, end in stretches(far.any(axis=0)):
        if first <= reached or motions.until_s[end - 1] - motions.since_s[first] <= 2.0 * WINDOW_S:
            continue
        groups = [list(group) for group, of in zip(PLACES_AND_TURNS, far, strict=True) if of[first:end].any()]
        if all(_is_a_share(motions.told[first:end, group], motions.made[first:end, group]) for group in groups):
            continue
        while first > 0 and unusual[:, first - 1].any():
            first -= 1
        while end < len(far[0]) and unusual[:, end].any():
            end += 1
        reached = end
        if motions.way_m(np.linalg.norm(motions.left[first:end], axis=1)) >= SHOWS_M:
            found.append((float(motions.since_s[first]), float(motions.until_s[end - 1])))
    lasts_s = float(motions.until_s[-1] - motions.since_s[0])
    if sum(until - since for since, until in found) > 0.5 * lasts_s:  # the rest is no more of the run than these
        return []
    return [_stretch(command, since, until) for since, until in found]


def _is_a_share(told, made) -> bool:
    """Whether wheels do a part of what they are told, in the same sense: most of their motion is a share of it."""
    share = float(np.sum(told * made) / max(np.sum(told**2), 1e-300))
    return share > 0.0 and np.sum((made - share * told) ** 2) < 0.5 * np.sum(made**2)


def _stretch(command, since_s, until_s):
    """The finding of a stretch, by what the samples of the command are there."""
    found = {"channel": COMMAND, "from_s": since_s, "to_s": until_s, "repairs": (CutOut(since_s, until_s),)}
    inside_s = np.clip(command.t, since_s, until_s)
    gap_s = float(np.where(are_gaps(np.diff(command.t)), np.diff(inside_s), 0.0).max())
    if gap_s > STUCK_S:
        return found | {"fault": "rows_missing", "what": f"no samples for {gap_s:.3g} s"}
    held = np.array(stretches(repeats(command.values)) or [(0, 0)])
    first, last = held[np.diff(inside_s[held]).argmax()]
    if command.values[first].any() and 2.0 * (inside_s[last] - inside_s[first]) > until_s - since_s:
        return found | {"fault": "channel_frozen", "what": "rows repeat, and the wheels do something else"}
    return found | {"fault": "command_overridden", "what": "the wheels do something else"}
