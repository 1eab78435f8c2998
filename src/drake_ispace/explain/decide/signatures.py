"""Stage 3, hypothesise: how much of what is left each effect could explain that the runs' own offsets cannot."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln
from scipy.stats import chi2

from drake_ispace.explain.fit.candidates import Candidate, probes
from drake_ispace.explain.fit.likelihood import Likelihood, Point, merged
from drake_ispace.explain.predict.prediction import Prediction, Residuals

_FAR = 500.0  # half a gain, beyond which the tail of chi square is taken by its asymptote
_LEAST = 1.0  # squared length of a signature below which the runs say nothing about the effect at that size


def minus_log10_p_of_gain(gain: np.ndarray, parameters: int) -> np.ndarray:
    """-log10 of the chance that `parameters` numbers fitted to noise gain so much, also where that is below 10^-300."""
    half, k = np.maximum(np.asarray(gain) / 2.0, _FAR), parameters / 2.0
    tail = -half + (k - 1.0) * np.log(half) - gammaln(k) + np.log1p((k - 1.0) / half)
    return -np.where(half > _FAR, tail, chi2.logsf(np.minimum(gain, 2.0 * _FAR), parameters)) / np.log(10.0)


@dataclass(frozen=True)
class Signature:
    """What an effect of size `z` would take away from the residuals.

    Attributes:
        at: the coordinate that is not neutral. one_sided: only sizes of this sign are possible. change: before minus
            after.
    """

    candidate: Candidate
    z: list[float]
    at: int
    one_sided: bool
    change: Residuals


def signatures(
    prediction: Prediction, point: Point, tried: Sequence[Candidate], scales: dict[str, float], base: Residuals,
    pool: ThreadPoolExecutor | None = None,
) -> list[Signature]:
    """One for every probe of every candidate, around `point` whose residuals are `base`."""
    found = []
    for candidate in tried:
        neutral = candidate.neutral
        for z in probes(candidate, scales):
            raw = prediction.residuals(merged({**point, candidate: z}), pool)
            if not all(np.isfinite(part).all() for run in raw for part in run.values()):
                continue
            change = [{s: before[s] - after[s] for s in before} for before, after in zip(base, raw, strict=True)]
            at = next((i for i in range(len(z)) if z[i] != neutral[i]), 0)
            low, high = candidate.bounds[at]
            one_sided = low >= neutral[at] or high <= neutral[at]
            found.append(Signature(candidate, z, at, one_sided, change))
    return found


class Screen:
    """Score tests of many effects at once.

    Args:
        likelihood: for the offsets. found: signatures at the point where the residuals were taken. changes: (k, rows)
            of each of them, whitened.
    """

    def __init__(self, likelihood: Likelihood, found: Sequence[Signature], changes: np.ndarray):
        self.signatures = list(found)
        self.changes = changes
        self.marginalised = likelihood.marginalised(changes)
        self.inner = changes @ self.marginalised.T
        self.length = np.diag(self.inner).copy()
        self.overdispersion = np.ones(len(found))
        self.one_sided = np.array([s.one_sided for s in found])
        self.candidates = list(dict.fromkeys(s.candidate for s in found))
        self._of = {c: [i for i, s in enumerate(found) if s.candidate is c] for c in self.candidates}

    def calibrate(self, noise: np.ndarray, blocks: np.ndarray) -> None:
        """Learn from `noise` (rows,) by how much it adds up along each signature beyond independent numbers.

        What a noise model forgets too early is still alike within a second: products with a signature are summed over
        `blocks` ((rows,), ascending numbers), and these sums count as the independent ones.
        """
        starts = np.flatnonzero(np.diff(blocks, prepend=-1))
        sums = np.add.reduceat(self.marginalised * noise, starts, axis=1)
        self.overdispersion = np.maximum(np.sum(sums**2, axis=1) / np.maximum(self.length, _LEAST), 1.0)

    def overdispersion_of(self, candidate: Candidate) -> float:
        """The largest over a candidate's signatures."""
        return float(self.overdispersion[self._of[candidate]].max()) if candidate in self._of else 1.0

    def gains(self, w: np.ndarray) -> np.ndarray:
        """(k,) how much each signature alone lowers the deviance of `w` (rows,)."""
        return self._gains(self.marginalised @ w)

    def _gains(self, g):
        shape = (-1,) + (1,) * (g.ndim - 1)
        gain = g**2 / (np.maximum(self.length, _LEAST) * self.overdispersion).reshape(shape)
        impossible = (self.one_sided.reshape(shape) & (g < 0.0)) | (self.length < _LEAST).reshape(shape)
        return np.where(impossible, 0.0, gain)

    def minus_log10_p(self, w: np.ndarray) -> np.ndarray:
        """(candidates,) -log10 of the p-value of the best use of each candidate, not corrected for trying many."""
        return self.minus_log10_p_of(self.marginalised @ w)

    def minus_log10_p_of(self, g: np.ndarray) -> np.ndarray:
        """The same from products of all signatures with residuals, (k,) or (k, trials)."""
        gains = self._gains(g)
        best = []
        for candidate in self.candidates:
            own = self._of[candidate]
            single = minus_log10_p_of_gain(gains[own].max(axis=0), 1)
            best.append(np.maximum(single, self._joint(own, g)) if len(candidate.parameters) > 1 else single)
        return np.array(best)

    def _joint(self, own, products):
        """-log10 p of all parameters of a candidate together, each by its first probe."""
        firsts = {}
        for i in own:
            if self.length[i] >= _LEAST:
                firsts.setdefault(self.signatures[i].at, i)
        firsts = list(firsts.values())
        if len(firsts) < 2:
            return np.zeros(products.shape[1:])
        g = products[firsts]
        gain = np.sum(g * (np.linalg.pinv(self.inner[np.ix_(firsts, firsts)], rcond=1e-8) @ g), axis=0)
        gain = gain / self.overdispersion[firsts].max()
        return minus_log10_p_of_gain(gain, len(firsts))

    def joint_gain(self, candidate: Candidate, w: np.ndarray) -> float:
        """How much all signatures of a candidate together lower the deviance of `w`."""
        own = [i for i in self._of[candidate] if self.length[i] >= _LEAST]
        return float(self.marginalised[own] @ w @ self._amounts(own, w))

    def _amounts(self, own, w):
        """(own,) how much of each of these signatures together explains most of `w`."""
        return np.linalg.pinv(self.inner[np.ix_(own, own)], rcond=1e-8) @ (self.marginalised[own] @ w)

    def use_of(self, effect, w: np.ndarray) -> tuple[np.ndarray, list[Residuals]]:
        """How much of each change by an effect's signatures together explains most of `w`, and these changes."""
        own = [i for i, s in enumerate(self.signatures) if s.candidate.effect is effect and self.length[i] >= _LEAST]
        return self._amounts(own, w), [self.signatures[i].change for i in own]

    def start(self, candidate: Candidate, w: np.ndarray) -> list[float]:
        """Coordinates at which a fit of the candidate should begin: its best probe, scaled to fit."""
        own = self._of[candidate]
        gains = self.gains(w)
        best = own[int(np.argmax(gains[own]))]
        found = self.signatures[best]
        amount = float(self.marginalised[best] @ w / max(self.length[best], _LEAST))
        neutral, z = candidate.neutral, list(found.z)
        for i, (low, high) in enumerate(candidate.bounds):
            share = min(max(amount, -3.0), 3.0)
            z[i] = min(max(neutral[i] + share * (found.z[i] - neutral[i]), low), high)
        return z

    def knows(self, candidate: Candidate) -> bool:
        """Whether it has a signature here."""
        return candidate in self._of

    def alike(self, one: Candidate, other: Candidate) -> float:
        """The largest |cosine| between signatures of two candidates, offsets left to themselves."""
        a, b = self._of[one], self._of[other]
        scale = np.sqrt(np.outer(np.maximum(self.length[a], _LEAST), np.maximum(self.length[b], _LEAST)))
        return float(np.max(np.abs(self.inner[np.ix_(a, b)]) / scale))
