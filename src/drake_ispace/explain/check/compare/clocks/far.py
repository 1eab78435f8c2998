"""Offsets of a clock beyond those that are looked at in every run: any at which half of a run is still compared.

GPS time is 18 s ahead of UTC, and a second computer may be set by hand. They are looked for only where a channel does
not follow the wheels as given. Of so many lags one may fit by chance: it must be clearly more likely than every other
one, and by it the channel must follow the wheels as well as one that is told to be those of another run.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from drake_ispace.explain.check.compare.agreement import SAID, WELL
from drake_ispace.explain.check.compare.clocks.paths import LAGS_S, LATEST_S, Path, least
from drake_ispace.explain.check.compare.clocks.trial import Trial, trials_of
from drake_ispace.explain.check.compare.foreign import GOES_WITH, follows
from drake_ispace.explain.check.compare.links import FEWEST, LATENCY_S, inside
from drake_ispace.explain.check.compare.motion import WINDOW_S


def far_offsets(trials: Sequence[Trial]) -> Iterator[tuple[Trial, Path, float]]:
    """Trials whose clock is off by more than LATEST_S, the offset, and by how much more likely it is than any latency.

    One offset is that of all runs in which the channel does not follow the wheels, if none of these contradicts it.
    """
    lost = [trial for trial in trials if not trial.link.any_share and _is_lost(trial)]
    own = [(trial, path) for trial, path in ((trial, _offset(trial)) for trial in lost) if path is not None]
    for path in dict.fromkeys(path for _, path in own):
        common = least(path.shifted(), lambda near: np.sum([trial.of_same_windows(near) for trial, _ in own], axis=0))
        gains = [trial.gain(common) for trial in lost]
        if all(_is_shown(trial, common) for trial, _ in own) and min(gains) > -SAID:
            yield from ((trial, common, gain) for trial, gain in zip(lost, gains, strict=True))
            return
    yield from ((trial, path, trial.gain(path)) for trial, path in own)


def far_jumps(trials: Sequence[Trial]) -> Iterator[tuple[Trial, Path, float]]:
    """Trials whose clock jumps so far that nothing of a channel lies inside of the wheels' run from then on.

    And the path along which it follows the wheels again, and by how much more likely that is than no relation. Either
    the channel's own stamps leave out as much, or those of the wheels.
    """
    for trial in trials:
        link, base = trial.link, trial.base
        left = [one.jump_s for one in trial.gaps] + base.parts[:-1, 1].tolist()
        for jump_s in [] if link.any_share else sorted(left):
            later = link.since_s >= jump_s
            if later.sum() < 2 * FEWEST or inside(base, link.since_s[later], link.until_s[later]).any():
                continue
            (part,) = trials_of([(trial.number, link.only(later), base)]) or [None]
            there = None if part is None else _offset(part)
            if there is None:
                continue
            lag_s = float(LAGS_S[trial.usual][np.argmin(trial.total[trial.usual])])
            at = int(np.searchsorted(link.t, jump_s))
            if there.lag_s - lag_s > link.t[at - 1] - link.t[at]:  # nothing was logged before what was logged earlier
                yield trial, Path(lag_s, 0.0, 0.0, there.lag_s - lag_s, jump_s), part.gain(there)
                break


def _is_lost(trial):
    """Whether a channel follows the wheels less than a sound one as given, or is not compared with them at all."""
    share = follows(trial.link, trial.base)
    return share is None or share < WELL


def _offset(trial):
    """The offset of a clock that is clearly the likeliest of all, if it is far; None: there is none."""
    lags_s = _lags_s(trial)
    if not len(lags_s):
        return None
    paths = [Path(lag) for lag in lags_s.tolist()]
    many = len(LAGS_S)
    lost = np.concatenate([trial.rough(paths[k : k + many]) for k in range(0, len(paths), many)])
    best, near = int(np.argmin(lost)), lags_s[lost <= lost.min() + SAID]
    is_far = abs(lags_s[best]) >= LATEST_S - 1e-9 and 0 < best < len(lags_s) - 1
    if not is_far or np.diff(near).max(initial=0.0) > WINDOW_S:  # motion that comes again tells no time
        return None
    path = least(paths[best].shifted(), trial.of_same_windows)
    return path if trial.gain(path) >= SAID + np.log(len(lags_s)) and _is_shown(trial, path) else None


def _lags_s(trial):
    """Lags [s], a latency apart, by which half of the windows or more lie inside of the wheels' run."""
    link, base = trial.link, trial.base
    begin, end = base.parts.T + 2.0 * base.rate_s * np.array([[1.0], [-1.0]])
    first, last = (begin[:, None] - link.since_s).ravel(), (end[:, None] - link.until_s).ravel()
    fits = first <= last  # of a window and a part of the run
    first, last = np.sort(first[fits]), np.sort(last[fits])
    edges = np.unique(np.concatenate([first, last]))
    inner = np.searchsorted(first, edges[:-1], "right") - np.searchsorted(last, edges[:-1], "right")
    enough = inner >= max(0.5 * len(link.since_s), 2 * FEWEST)
    numbers = [
        np.arange(np.ceil(low / LATENCY_S), np.floor(high / LATENCY_S) + 1.0)
        for low, high in zip(edges[:-1][enough], edges[1:][enough], strict=True)
    ]
    return LATENCY_S * np.unique(np.concatenate([[], *numbers]))


def _is_shown(trial, path):
    """Whether along a path a channel follows the wheels as well as one that is told to be those of another run."""
    share = follows(trial.link, trial.base, path.lag_s)
    return share is not None and share > GOES_WITH
