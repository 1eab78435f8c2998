"""Score tests: how much of the whitened residuals each effect could explain beyond nuisances."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import gammaln
from scipy.stats import chi2

from drake_ispace.explain.decide.survey.signatures import Signature
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.predict.prediction import Residuals

_LEAST = 1.0  # squared length of a signature below which the runs say nothing about the effect at that size


class Screen:
    """Score tests of many effects at once.

    They take products (k,) of what is left of each signature, nuisances marginalised, with whitened residuals.

    Args:
        signatures: k of them, at the point at which the residuals were taken. inner: (k, k) products of the whitened
            signatures with what nuisances leave of them.

    Attributes:
        signatures, inner: the arguments. candidates: the effects that have a signature, each once. length: (k,) the
            diagonal of `inner`, which is the squared length of each signature. overdispersion: (k,) at least 1, see
            `calibrate`. blocks: how many told it. one_sided: (k,) whether only sizes of one sign are possible.
    """

    def __init__(self, signatures: Sequence[Signature], inner: np.ndarray):
        self.signatures = list(signatures)
        self.inner = inner
        self.length = np.diag(self.inner).copy()
        self.overdispersion = np.ones(len(signatures))
        self.blocks = 0
        self.one_sided = np.array([s.one_sided for s in signatures], dtype=bool)
        self.candidates = list(dict.fromkeys(s.candidate for s in signatures))
        self._of = {c: [i for i, s in enumerate(signatures) if s.candidate is c] for c in self.candidates}

    def light(self) -> "Screen":
        """The Screen with signatures that have no changes of residuals any more; all but `use_of` can be asked."""
        other = Screen([replace(signature, change=[]) for signature in self.signatures], self.inner)
        other.overdispersion, other.blocks = self.overdispersion, self.blocks
        return other

    def calibrate(self, sums: np.ndarray) -> None:
        """Learn the overdispersion: how much more noise adds up along each signature than independent numbers would.

        A noise model may forget too early; what it leaves is still correlated within a second. Products with a
        signature are therefore summed over blocks, and the sums are taken as independent.

        sums: (k, blocks) of products with whitened residuals that nothing explains.
        """
        self.blocks = sums.shape[1]
        self.overdispersion = np.maximum(np.sum(sums**2, axis=1) / np.maximum(self.length, _LEAST), 1.0)

    def clearest(self, products: np.ndarray) -> list[int]:
        """Numbers of the signatures of the candidate whose test is the clearest; products: (k,)."""
        return self._shown(self.candidates[int(np.argmax(self.minus_log10_p(products)))]) if self.candidates else []

    def _shown(self, candidate):
        """Numbers of those signatures of a candidate that the runs show."""
        return [i for i in self._of[candidate] if self.length[i] >= _LEAST]

    def _firsts(self, candidate):
        """Numbers of the first signature of every parameter of a candidate that the runs show.

        Sums of several would have a motion of their own, by which the effect is not linear in the parameter.
        """
        first_of = {}
        for i in self._shown(candidate):
            first_of.setdefault(self.signatures[i].at, i)
        return list(first_of.values())

    def overdispersion_of(self, candidate: Candidate) -> float:
        """The largest overdispersion over the signatures of a candidate; 1 if it has none."""
        return float(self.overdispersion[self._of[candidate]].max()) if candidate in self._of else 1.0

    def minus_log10_p(self, products: np.ndarray) -> np.ndarray:
        """(candidates,) or (candidates, trials) -log10 p of the best use of each candidate, not corrected for trying
        many; products: (k,) or (k, trials)."""
        gains = self.gains(products)
        best = []
        for candidate, indices in self._of.items():
            found = [minus_log10_p_of_gain(gains[indices].max(axis=0), 1)]
            found += [minus_log10_p_of_gain(gain, k) for k, gain in self._gains_together(candidate, products)]
            best.append(np.max(found, axis=0))
        return np.array(best)

    def largest(self, products: np.ndarray) -> np.ndarray:
        """(trials,) the largest of `minus_log10_p` over all candidates; products: (k, trials)."""
        gains = {1: self.gains(products).max(axis=0)}
        for candidate in self.candidates:
            for k, gain in self._gains_together(candidate, products):
                gains[k] = np.maximum(gains.get(k, 0.0), gain)
        return np.max([minus_log10_p_of_gain(gain, k) for k, gain in gains.items()], axis=0)

    def start(self, candidate: Candidate, products: np.ndarray) -> list[float]:
        """Coordinates at which a fit of the candidate should begin: its best probe, scaled to fit; products: (k,)."""
        indices = self._of[candidate]
        gains = self.gains(products)
        best = indices[int(np.argmax(gains[indices]))]
        signature = self.signatures[best]
        amount = float(products[best] / max(self.length[best], _LEAST))
        share = min(max(amount, -3.0), 3.0)
        return [
            min(max(neutral + share * (z - neutral), low), high)
            for z, neutral, (low, high) in zip(signature.z, candidate.neutral, candidate.bounds, strict=True)
        ]

    def probes_of(self, candidate: Candidate) -> list[list[float]]:
        """Coordinates of the candidate at which its signatures were taken."""
        return [list(self.signatures[i].z) for i in self._of[candidate]]

    def gains(self, products: np.ndarray) -> np.ndarray:
        """(k,) or (k, trials) drop in deviance over the overdispersion, each signature fitted by itself.

        It is zero where the best size has an impossible sign, and where the runs say nothing about the effect.
        """
        shape = (-1,) + (1,) * (products.ndim - 1)
        gains = products**2 / (np.maximum(self.length, _LEAST) * self.overdispersion).reshape(shape)
        impossible = (self.one_sided.reshape(shape) & (products < 0.0)) | (self.length < _LEAST).reshape(shape)
        return np.where(impossible, 0.0, gains)

    def _gains_together(self, candidate, products):
        """Yield the number of parameters of a candidate and the gain of all together, if the runs show several.

        Each is taken by its first signature that they show.
        """
        firsts = self._firsts(candidate)
        if len(firsts) > 1:
            g = products[firsts]
            gain = np.sum(g * (self._inverse(firsts) @ g), axis=0)
            yield len(firsts), gain / self.overdispersion[firsts].max()

    def joint_drop(self, candidate: Candidate, products: np.ndarray) -> float:
        """Drop in deviance, all signatures of a candidate fitted together; products: (k,)."""
        indices = self._shown(candidate)
        return float(products[indices] @ self.amounts(indices, products))

    def use_of(self, effect, products: np.ndarray) -> tuple[np.ndarray, list[Residuals]]:
        """The best amount of each signature of an effect, fitted together, and their changes; products: (k,)."""
        shown = self.length >= _LEAST
        indices = [i for i, s in enumerate(self.signatures) if s.candidate.effect is effect and shown[i]]
        return self.amounts(indices, products), [self.signatures[i].change for i in indices]

    def amounts(self, indices: Sequence[int], products: np.ndarray) -> np.ndarray:
        """(len(indices),) how much of each of these signatures, fitted together, explains most."""
        return self._inverse(indices) @ products[indices]

    def covariance_of(self, candidate: Candidate) -> np.ndarray:
        """(n, n) of the amounts of a candidate's signatures that the runs show, fitted together."""
        return self._inverse(self._shown(candidate)) * self.overdispersion_of(candidate)

    def _inverse(self, indices):
        """(n, n) inverse of the products of these signatures."""
        return np.linalg.pinv(self.inner[np.ix_(indices, indices)], rcond=1e-8)

    def knows(self, candidate: Candidate) -> bool:
        """Whether the candidate has a signature."""
        return candidate in self._of

    def alike(self, one: Candidate, other: Candidate, rest: Sequence[Candidate] = ()) -> float:
        """The largest |cosine| between a signature of one candidate and what all of the other's can make of it.

        Nuisances are marginalised, and so are the candidates of `rest`, which may have any size. All of the other's:
        slip along x and y together looks like a smaller room, and neither alone does.
        """
        a, b, free = self._shown(one), self._shown(other), [i for c in rest for i in self._firsts(c)]
        if not a or not b:
            return 0.0
        both = [*a, *b]
        to_free, among_free = self.inner[np.ix_(free, both)], self.inner[np.ix_(free, free)]
        left = self.inner[np.ix_(both, both)] - to_free.T @ np.linalg.pinv(among_free, rcond=1e-8) @ to_free
        some, others = slice(len(a)), slice(len(a), None)
        return max(_share(left, some, others), _share(left, others, some)) ** 0.5

    def sets_of(self, candidates: Sequence[Candidate], count: int, products: np.ndarray) -> list[list[Candidate]]:
        """Sets of so many of the candidates, those first that together explain most; products: (k,).

        Only sets with one candidate more than the best smaller ones are tried, of which as many are kept as there are
        candidates.
        """
        shown, sets = [self._firsts(candidate) for candidate in candidates], [()]
        for _ in range(count):
            larger = sorted({tuple(sorted({*some, i})) for some in sets for i in range(len(shown)) if i not in some})
            indices = [[at for i in some for at in shown[i]] for some in larger]
            drops = [float(products[among] @ self.amounts(among, products)) for among in indices]
            sets = [larger[i] for i in np.argsort(-np.array(drops), kind="stable")[: len(shown)]]
        return [[candidates[i] for i in some] for some in sets]


def _share(products, some, others):
    """The largest share of the squared length of one of some vectors that others together explain.

    products: (n, n) of all vectors with each other. some, others: slices of them.
    """
    between = products[others, some]
    explained = np.sum(between * (np.linalg.pinv(products[others, others], rcond=1e-8) @ between), axis=0)
    return float(np.max(np.maximum(explained, 0.0) / np.maximum(np.diag(products)[some], _LEAST)))


def gain_at(minus_log10_p: float, parameters: int = 1) -> float:
    """The drop in deviance that so many numbers fitted to noise reach with this probability, as -log10 p."""
    return float(chi2.isf(10.0**-minus_log10_p, parameters))


def minus_log10_p_of_gain(gain: np.ndarray, parameters: int) -> np.ndarray:
    """-log10 of the probability that `parameters` numbers fitted to noise gain as much.

    A probability that is too small for a number is taken by its asymptote. gain: drop in deviance over the
    overdispersion.
    """
    p, least = chi2.sf(gain, parameters), np.finfo(float).tiny
    half, k = np.maximum(np.asarray(gain) / 2.0, 1.0), parameters / 2.0
    tail = -half + (k - 1.0) * np.log(half) - gammaln(k) + np.log1p((k - 1.0) / half)
    return -np.where(p > least, np.log(np.maximum(p, least)), tail) / np.log(10.0)
