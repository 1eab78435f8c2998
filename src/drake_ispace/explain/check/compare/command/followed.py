"""Do the wheels do as commanded? Columns that command nothing, and stretches in which the wheels do otherwise.

Wheels that each do a share of what they are told, or come ever nearer to it, obey a drive that is weak or limited. If
all stand, or turn otherwise, another command is in force than the one that was logged.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_ispace.explain.check.compare.command.drive import Drive, Following, best_following
from drake_ispace.explain.check.compare.links import FEWEST, PLACES_AND_TURNS, RATE_S, Base, inside
from drake_ispace.explain.check.compare.motion import WINDOW_S, arm
from drake_ispace.explain.check.compare.regression import MOST_SLACK, SLACK, residuals
from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.check.sampling.samples import STUCK_S, stretches
from drake_ispace.explain.check.sampling.stamps import are_gaps
from drake_ispace.explain.check.steps import SHOWS_M
from drake_ispace.explain.levels import largest_by_chance
from drake_ispace.faults.repair import CutOut, Without
from drake_ispace.robots.robot import COMMAND


def followed_findings(drives: Mapping[int, Drive], bases: Sequence[Base | None]) -> list[Finding]:
    """What the wheels do not do as commanded.

    drives: number of a run -> its command and wheels. bases: of every run.
    """
    if not drives:
        return []
    step_s = float(np.median([drive.step_s for drive in drives.values()]))
    rates = {i: drive.held() for i, drive in drives.items()}
    follows = best_following([(drive, rates[i]) for i, drive in drives.items()], step_s, -1.0)
    found = []
    for i, drive in drives.items():
        motions = _motions(drive, rates[i], bases[i], follows)
        if motions is not None:
            of_run = _dead(drive.command, motions) or _otherwise(drive.command, motions)
            found += [replace(finding, runs=(i,)) for finding in of_run]
    return found


@dataclass(frozen=True)
class _Motions:
    """Motions (k, 3) of the body in overlapping windows [m]; turns as lengths.

    told: as the drive would carry them out. made: by the wheels. left: of `made`, what `told` does not explain, physics
    of plausible size included. noise: (3,) of `made`. turns: (2, k, n) [rad] of the wheels, told and made. apart:
    windows from one to the next that does not overlap it.
    """

    since_s: np.ndarray
    until_s: np.ndarray
    told: np.ndarray
    made: np.ndarray
    left: np.ndarray
    noise: np.ndarray
    turns: np.ndarray
    apart: int

    def way_m(self, motions: np.ndarray) -> float:
        """How far motions (k, ...) go, all in all."""
        return float(np.abs(motions).sum() / self.apart)


def _motions(drive: Drive, rates: np.ndarray, base: Base, follows: Following) -> _Motions | None:
    """The motions of a run; None where too few windows are sound. rates: as of `Drive.held`."""
    unit = np.array([1.0, 1.0, arm(base.geometry)])
    told = follows.gain * drive.predicted(rates, follows.late_s, follows.lag_s)
    apart = max(1, round(WINDOW_S / float(np.median(np.diff(drive.edges)))))
    edges = np.arange(len(drive.edges) - apart)
    since, until = drive.edges[edges], drive.edges[edges + apart]
    kept = inside(base, since, until)
    if kept.sum() < FEWEST * apart:
        return None
    total = (np.vstack([np.zeros(turns.shape[1]), np.cumsum(turns, axis=0)]) for turns in (told, drive.turned))
    turns = np.stack([(of[edges + apart] - of[edges])[kept] for of in total])
    told, made = turns @ base.geometry.forward.T * unit
    return _Motions(since[kept], until[kept], told, made, residuals(told, made), base.noise * unit, turns, apart)


def _dead(command, motions):
    """Columns with one value only, while the robot moves along that axis farther than physics makes of the others.

    What is between rest and what is told does not count: a weak drive obeys.
    """
    least = SHOWS_M + SLACK * motions.way_m(np.linalg.norm(motions.told, axis=1))
    nearest = np.clip(motions.made, np.minimum(motions.told, 0.0), np.maximum(motions.told, 0.0))
    otherwise = np.where(motions.made == nearest, 0.0, motions.left)
    still = [
        name for axis, name in enumerate(command.columns)
        if np.ptp(command.column(name)) == 0.0 and motions.way_m(otherwise[:, axis]) > least
    ]
    if not still:
        return []
    values = ", ".join(f"{name} is always {command.column(name)[0]:.4g}" for name in still)
    what = f"{values}, and the wheels do otherwise"
    return [Finding("channel_dead", what, COMMAND, repairs=(Without(COMMAND),))]


def _otherwise(command, motions):
    """Stretches of more than two windows in which wheels do more otherwise than as told."""
    unusual, far = (np.zeros((len(PLACES_AND_TURNS), len(motions.left)), bool) for _ in range(2))
    for k, group in enumerate(map(list, PLACES_AND_TURNS)):
        left, told, made = (np.linalg.norm(of[:, group], axis=1) for of in (motions.left, motions.told, motions.made))
        usual = largest_by_chance(len(left) // motions.apart, len(group)) * max(
            np.median(left), motions.noise[group].max()
        )
        size = float(np.sqrt(np.mean(told**2)))
        unusual[k] = left > max(usual, SLACK * size)
        far[k] = (left > max(usual, MOST_SLACK * size)) & (left > np.maximum(told, made) - left)
    found, reached = [], -1
    for first, end in stretches(far.any(axis=0)):
        if first <= reached or motions.until_s[end - 1] - motions.since_s[first] <= 2.0 * WINDOW_S:
            continue
        if _obeys(motions, slice(first, end)):
            continue
        while first > 0 and unusual[:, first - 1].any():
            first -= 1
        while end < len(far[0]) and unusual[:, end].any():
            end += 1
        reached = end
        has_hole = np.diff(motions.since_s[first:end]).max(initial=0.0) > WINDOW_S
        if not has_hole and motions.way_m(np.linalg.norm(motions.left[first:end], axis=1)) >= SHOWS_M:
            found.append((float(motions.since_s[first]), float(motions.until_s[end - 1])))
    lasts_s = float(motions.until_s[-1] - motions.since_s[0])
    if sum(until - since for since, until in found) > 0.5 * lasts_s:  # the rest is no more of the run than these
        return []
    return [_stretch(command, since, until) for since, until in found]


def _obeys(motions, those) -> bool:
    """Whether a weak or limited drive obeys: each wheel does a share of what it is told, or all come ever nearer to it.

    Nearer as evenly as behind a limit of braking, or faster at first. Wheels that all stand obey nothing.
    """
    lasts = those.stop - those.start
    inner = slice(those.start + lasts // 4, those.stop - lasts // 4)  # not where it begins and ends
    told, made = motions.turns[:, inner]
    squares = np.sum(told**2, axis=0)
    if np.sum(made**2) < SLACK**2 * np.sum(squares):
        return False
    shares = np.clip(np.sum(told * made, axis=0) / np.maximum(squares, 1e-300), 0.0, 1.0)
    otherwise = np.sum((made - shares * told) ** 2, axis=0)
    if np.all(otherwise < MOST_SLACK**2 * np.maximum(np.sum(made**2, axis=0), squares)):
        return True
    left = np.linalg.norm(motions.left[those], axis=1)
    nearer = left[left.argmax() :]
    evenly = np.linspace(nearer[0], nearer[-1], len(nearer))
    goes_on = 2 * len(nearer) >= len(left) and nearer[0] - nearer[-1] > MOST_SLACK * nearer[0]
    return goes_on and bool(np.all(nearer <= evenly + SLACK * nearer[0]))


def _stretch(command, since_s, until_s):
    """The finding of a stretch: rows that are missing in a log of steady steps, or another command."""
    steps, inside_s = np.diff(command.t), np.diff(np.clip(command.t, since_s, until_s))
    gap_s = float(np.where(are_gaps(steps), inside_s, 0.0).max())
    fault, what = "command_overridden", "the wheels do something else"
    if gap_s > STUCK_S and np.median(steps) <= RATE_S:
        fault, what = "rows_missing", f"no samples for {gap_s:.3g} s"
    return Finding(fault, what, COMMAND, since_s, until_s, repairs=(CutOut(since_s, until_s),))
