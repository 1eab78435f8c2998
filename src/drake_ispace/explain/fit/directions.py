"""Vectors as long as the residuals, a row each: sums, scalar products, and least squares where some nearly coincide."""

from dataclasses import dataclass

import numpy as np

_BLOCK = 4096  # numbers of each vector that are taken at once
_LEAST_EIGENVALUE = 1e-9  # as a share of the largest; below it directions coincide


@dataclass(frozen=True)
class Part:
    """Some of `size` vectors, the others being zero.

    Attributes:
        rows: (m, n) the vectors. places: (m,) their numbers. size: how many there are.
    """

    rows: np.ndarray
    places: np.ndarray
    size: int

    def __len__(self) -> int:
        return self.size

    def dot(self, vectors: np.ndarray) -> np.ndarray:
        """(k, size) scalar products with vectors (k, n)."""
        products = np.zeros((len(vectors), self.size))
        products[:, self.places] = vectors @ self.rows.T
        return products

    def combined(self, amounts: np.ndarray) -> np.ndarray:
        """(k, n) sums of the vectors, each times its amount (k, size)."""
        return amounts[:, self.places] @ self.rows

    def gram(self) -> np.ndarray:
        """(size, size) scalar products of the vectors with each other."""
        products = np.zeros((self.size, self.size))
        products[np.ix_(self.places, self.places)] = self.rows @ self.rows.T
        return products

    def spread(self, numbers: np.ndarray) -> np.ndarray:
        """(size, ...) what `numbers` (m, ...) has of the vectors, zero for the others."""
        spread = np.zeros((self.size, *numbers.shape[1:]))
        spread[self.places] = numbers
        return spread


def _blocks(part):
    """Slices of the columns of `part` (q, n), and each block in double precision, small enough for a core's memory."""
    for first in range(0, part.shape[1], _BLOCK):
        columns = slice(first, first + _BLOCK)
        yield columns, np.asarray(part[:, columns], float)


def dot(vectors, part):
    """(q,) or (m, q) scalar products of (n,) or (m, n) vectors with those of `part` (q, n), in double precision."""
    total = np.zeros((*vectors.shape[:-1], len(part)))
    for columns, block in _blocks(part):
        total += (block if vectors is part else np.asarray(vectors[..., columns], float)) @ block.T
    return total


def add(amounts, part, total):
    """Add the vectors of `part` (q, n), each times its amount (q,) or (m, q), to `total` (n,) or (m, n)."""
    for columns, block in _blocks(part):
        total[..., columns] += amounts @ block


def amounts_of(gram: np.ndarray, products: np.ndarray) -> np.ndarray:
    """(k,) amounts of k vectors whose sum comes nearest to y; vectors that nearly coincide share theirs.

    gram: (k, k) scalar products of the vectors with each other. products: (k,) with y.
    """
    return inverse_of(gram, _LEAST_EIGENVALUE) @ products


def spent_on(gram: np.ndarray, columns: np.ndarray) -> float:
    """How many of m numbers a fit of k vectors takes for itself: as many as it leaves fewer degrees of freedom there.

    gram: (k, k) as for `amounts_of`. columns: (k, m) the vectors' entries at these numbers.
    """
    return float(np.vdot(columns, inverse_of(gram, _LEAST_EIGENVALUE) @ columns))


def errors_of(gram: np.ndarray, count: int) -> np.ndarray:
    """(count, k) errors of `amounts_of` a y of independent numbers of unit variance.

    The sum of their outer products is the covariance of the amounts but for products of directions that are
    independent of each other.

    gram: (k, k) as for `amounts_of`.
    """
    root = root_of_inverse(gram, _LEAST_EIGENVALUE)
    return np.array([root[:, first::count].sum(axis=1) for first in range(count)])


def inverse_of(gram: np.ndarray, least: float | None = None, squares: np.ndarray | None = None) -> np.ndarray:
    """(k, k) the pseudo-inverse of scalar products of vectors with each other; arguments: as of `root_of_inverse`."""
    root = root_of_inverse(gram, least, squares)
    return root @ root.T


def root_of_inverse(gram: np.ndarray, least: float | None = None, squares: np.ndarray | None = None) -> np.ndarray:
    """(k, r) a root of `inverse_of`, as found for vectors of unit length; r is the number of directions.

    least: eigenvalue, as a share of the largest, below which directions coincide; None: that of rounding. squares: (k,)
    squared lengths by which rounding is judged: those before something was taken from the vectors; default as they are.
    """
    squares = np.diag(gram) if squares is None else squares
    lengths = np.sqrt(np.where(squares > 0.0, squares, 1.0))
    values, vectors = np.linalg.eigh(gram / np.outer(lengths, lengths))
    kept = values > (np.finfo(float).eps * len(values) if least is None else least) * values.max(initial=0.0)
    return vectors[:, kept] / np.sqrt(values[kept]) / lengths[:, None]
