"""At which moments between two samples of its log did a command change?

A log with a fixed step shows a change up to a step late, each by another amount, and on the average half a step. Wheels
tell these moments from each other; from a drive's own delay they are told by lying within one step.
"""

from collections.abc import Mapping

import numpy as np
from scipy.sparse import csr_array, lil_array
from scipy.special import logsumexp, softmax
from scipy.stats import norm, truncnorm

from drake_ispace.explain.check.compare.agreement import ALIKE, SAID
from drake_ispace.explain.check.compare.command.drive import BLOCK_S, Drive, Following, best_following
from drake_ispace.explain.check.compare.links import FEWEST
from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.levels import CHANCE
from drake_ispace.faults.repair import Restamped
from drake_ispace.robots.robot import COMMAND

_ANSWERED = -np.log(np.finfo(float).eps)  # time constants, after which all of a change has come
_SHARES = np.linspace(0.0, 1.0, 20, endpoint=False)  # of changes that act at their samples
_LEVEL = np.sqrt(np.finfo(float).eps)  # share of the mean squared length, below which a change shows nothing


def moment_findings(drives: Mapping[int, Drive]) -> list[Finding]:
    """The findings, one of each run, that a command changed between its samples; none where it changed at them.

    drives: number of a run -> its command and wheels.
    """
    samples = {i: _changed(drive) for i, drive in drives.items()}
    drives = {i: drive for i, drive in drives.items() if len(samples[i])}
    if sum(len(samples[i]) for i in drives) < FEWEST:
        return []
    step_s = float(np.median([drive.step_s for drive in drives.values()]))
    answers = [np.vstack(every) for every in zip(*(_answers(drives[i], samples[i]) for i in drives), strict=True)]
    ends = np.cumsum([len(samples[i]) for i in drives])[:-1]
    moved = {i: np.zeros(len(drive.command.t)) for i, drive in drives.items()}
    score, gained = 0.0, np.inf
    while gained > ALIKE:  # until the moments, and how wheels follow what changes then, are as likely as before
        rates = {i: drive.held(moved[i]) for i, drive in drives.items()}
        follows = best_following([(drive, rates[i]) for i, drive in drives.items()], step_s, -1.0)
        found = [_moments(drive, samples[i], moved[i], rates[i], follows) for i, drive in drives.items()]
        earlier, std, cautious = (np.concatenate(each) for each in zip(*found, strict=True))
        at_once, half, within, twice = (
            _scored(earlier, cautious, answers, k * step_s)[0] for k in (0.0, 0.5, 1.0, 2.0)
        )
        score, gained = within - at_once, within - at_once - score
        if score < SAID or not (std < step_s).any():
            return []
        _, answered = _scored(earlier, std, answers, step_s)
        expected = _within_a_step(earlier - answered, std, step_s, follows.late_s)
        for i, one in zip(drives, np.split(expected, ends), strict=True):
            moved[i][samples[i]] = one
    if max(half, twice) > within + ALIKE:  # the drive's answers scatter, whatever the step of the log
        return []
    return [
        Finding(
            "command_moments", f"{len(samples[i])} changes up to {1e3 * moved[i].max():.2g} ms earlier than logged",
            COMMAND, runs=(i,), drop_in_deviance=2.0 * score,
            repairs=(Restamped(COMMAND, tuple(samples[i].tolist()), tuple(moved[i][samples[i]].tolist())),),
        ) for i in drives
    ]


def _changed(drive):
    """(c,) samples that show a change, as far as wheels show what comes of it; none of a command that ramps."""
    samples = np.flatnonzero(drive.changes.any(axis=1)) + 1
    t = drive.command.t[samples]
    shown = (t > drive.edges[0] + drive.step_s) & (t < drive.edges[-1] - drive.step_s)
    return samples[:0] if drive.ramps else samples[shown]


def _moments(
    drive: Drive, samples: np.ndarray, moved: np.ndarray, rates: np.ndarray, follows: Following
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """By how much the changes at some samples (c,) act before them [s], and the standard deviations, all (c,).

    These moments explain best how far the wheels turned. A constant of all of them cannot be told from the lateness in
    `follows`. The first standard deviation is of noise that is new in every window. The other one is of noise that
    belongs together within a block, as where a drive is too fast for a while: by it is judged whether changes lie
    within a step at all. moved: (all samples,) [s] by how much earlier they are in the rates (k, n) that the wheels are
    told.
    """
    sizes, since = drive.changes[samples - 1], drive.command.t[samples] - moved[samples] + follows.late_s
    first = np.maximum(np.searchsorted(drive.edges, since, side="right") - 1, 0)
    last = np.searchsorted(drive.edges, since + _ANSWERED * follows.lag_s) + 1  # as an end of a slice
    columns = lil_array((len(samples), drive.turned.size))
    for k, (a, b) in enumerate(zip(first, last, strict=True)):
        after = np.maximum(drive.edges[a:b] - since[k], 0.0)
        gained = np.diff(-np.expm1(-after / follows.lag_s) if follows.lag_s > 0.0 else np.sign(after))
        turned = np.outer(gained, follows.gain * drive.geometry.inverse @ sizes[k])
        columns[k, a * turned.shape[1] : a * turned.shape[1] + turned.size] = turned.ravel()
    columns = columns.tocsr()
    left = (drive.turned - follows.gain * drive.predicted(rates, follows.late_s, follows.lag_s)).ravel()
    normal, product = (columns @ columns.T).toarray(), columns @ left
    if not normal.any():  # no wheel answers: a moment is anywhere in the run
        return moved[samples], *np.full((2, len(samples)), drive.edges[-1] - drive.edges[0])
    inverse = np.linalg.inv(normal + _LEVEL * np.trace(normal) / len(samples) * np.eye(len(samples)))
    more = inverse @ product
    unexplained, free = left - more @ columns, max(len(left) - len(samples), 1)
    noise = np.sqrt(np.sum(unexplained**2) / free) + 1e-12
    sums = _covariance(columns, unexplained.reshape(drive.turned.shape), drive.edges) * len(left) / free
    together = np.maximum(np.sum(inverse @ sums * inverse, axis=1), 0.0)
    return moved[samples] + more, noise * np.sqrt(np.diag(inverse)), np.sqrt(together) + 1e-12


def _covariance(columns, noise: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """(c, c) covariance of sums of noise (m, n) of n wheels, times sparse columns (c, m n).

    A drive that is too fast for a while is so in many windows, as if a change had come earlier, the more the longer the
    drive takes for a change. Noise is taken to be alike throughout the run, and to belong together within a block
    (Newey and West, 1987).
    edges: (m + 1,) [s] of the windows.
    """
    (m, n), sums = noise.shape, np.zeros((columns.shape[0],) * 2)
    windows = min(max(1, round(BLOCK_S / float(np.median(np.diff(edges))))), m)
    places, ends = np.repeat(np.arange(m * n).reshape(m, n), n, axis=0).ravel(), n * np.arange(m * n + 1)
    for k in range(windows):
        together, rows = (1.0 - k / windows) * (noise[k:].T @ noise[: m - k]) / m, (m - k) * n
        of_each = np.tile(together.ravel(), m - k), places[: rows * n], ends[: rows + 1]  # one block for each window
        of_later = columns[:, k * n :] @ csr_array(of_each, shape=(rows, rows))
        of_pairs = (of_later @ columns[:, : (m - k) * n].T).toarray()
        sums += of_pairs + of_pairs.T if k else of_pairs
    return sums


def _answers(drive, samples) -> list[np.ndarray]:
    """Ways in which a drive may be late at changes of its command whenever they act: (c, 1), (c, 4), (c, 14) columns.

    The lateness is a sum of columns, each times an amount that is the same for all changes. The first way is a
    constant. In the others it is one for translation and one for turning; where both change, wheels show the mean of
    both, by how much either turns them. The second way grows linearly with the size of a change. The third is quadratic
    in it, apart for speeds that fall and others, as under a limit of acceleration, with the part of the change on which
    the speed falls besides, as where brakes are slow.
    """
    before, changes = drive.command.values[samples - 1], drive.changes[samples - 1]
    turned, axes = drive.geometry.inverse, ([0, 1], [2])
    parts = np.column_stack([np.sum((changes[:, own] @ turned[:, own].T) ** 2, axis=1) for own in axes])
    shares = parts / np.maximum(parts.sum(axis=1, keepdims=True), np.finfo(float).tiny)
    sizes, speeds, reached = (
        np.column_stack([np.linalg.norm(velocities[:, own], axis=1) for own in axes])
        for velocities in (changes, before, before + changes)
    )
    against = -np.column_stack([np.sum(before[:, own] * changes[:, own], axis=1) for own in axes])
    braking = np.clip(against / np.maximum(sizes**2, np.finfo(float).tiny), 0.0, 1.0)  # share of the way to the slowest
    slower, linear = reached < speeds, [shares * sizes**power for power in range(2)]
    slow_brakes = shares * sizes * braking * (1.0 - 0.5 * braking)
    apart = [shares * which * sizes**power for which in (slower, ~slower) for power in range(3)]
    return [np.ones((len(samples), 1)), np.hstack(linear), np.hstack([*apart, slow_brakes])]


def _scored(earlier, std, answers, step_s):
    """The log likelihood that changes act before their samples by anything between zero and a step, each by its own.

    The drive's own answer is added to it, that of `answers` which makes this likeliest. Its amounts have normal priors:
    at the largest change each answer is as late as `earlier` is in the mean square. Returned besides: (c,) [s] what the
    simplest answer that is likely enough (SAID) has of `earlier`, but for a constant.

    earlier, std: (c,) how much earlier each acts, and its standard deviation [s]. answers: as of `_answers`.
    """
    spread, scale, found = np.sqrt(std**2 + step_s**2 / 12.0), np.sqrt(np.mean(earlier**2)), []
    for answer in answers:
        amounts = np.eye(answer.shape[1])
        columns = scale * answer / np.maximum(answer.max(axis=0), 1e-12) / spread[:, None]
        q, r = np.linalg.qr(np.vstack([columns, amounts]))
        shown = np.concatenate([earlier / spread, np.zeros(len(amounts))])
        left = shown - q @ (q.T @ shown)
        likelihood = float(-0.5 * left @ left - np.log(np.abs(np.diag(r))).sum() - np.log(spread).sum())
        answered = earlier - left[: len(earlier)] * spread
        found.append((likelihood, answered - np.average(answered, weights=spread**-2.0)))
    most = max(likelihood for likelihood, _ in found)
    return most, next(answered for likelihood, answered in found if likelihood > most - SAID)


def _within_a_step(earlier: np.ndarray, std: np.ndarray, step_s: float, late_s: float) -> np.ndarray:
    """(c,) by how much changes are expected to act before their samples [s], where none does by more than a step.

    earlier, std: (c,) what wheels say of it, but for a constant, and the standard deviation [s]. late_s: by which the
    wheels answer if that constant is zero. Where the step leaves room for it, the constant is that of wheels that
    answer at once. Of a log that keeps only some of the commanded samples some changes act at their samples; any share
    of them may.
    """
    known = earlier[std < step_s]
    constants = np.linspace(-known.max(), step_s - known.min(), round(1.0 / CHANCE))  # of which one is as rare as that
    densities = _densities(earlier + constants[:, None], std, step_s)
    weights = softmax(logsumexp([_mixed(*densities, share)[0] for share in _SHARES], axis=0))
    least, most = np.interp((CHANCE, 1.0 - CHANCE), np.cumsum(weights), constants)
    each = earlier + (-late_s if least <= -late_s <= most else constants @ weights)
    densities = _densities(each, std, step_s)
    fits, between = zip(*(_mixed(*densities, share) for share in _SHARES), strict=True)
    return softmax(fits) @ between * truncnorm.mean(-each / std, (step_s - each) / std, loc=each, scale=std)


def _densities(earlier, std, step_s):
    """(..., c) of changes that act anywhere in the step before their samples, and of those that act at them."""
    low, high = -earlier / std, (step_s - earlier) / std
    return norm.cdf(high) - norm.cdf(low), step_s * norm.pdf(low) / std


def _mixed(anywhere, at_once, share):
    """(...) log likelihood if a share of the changes acts at its sample, (..., c) probability of each that it does not.

    anywhere, at_once: `_densities`.
    """
    anywhere, at_once = (1.0 - share) * anywhere, share * at_once
    either = np.maximum(anywhere + at_once, np.finfo(float).tiny)
    return np.log(either).sum(axis=-1), anywhere / either
