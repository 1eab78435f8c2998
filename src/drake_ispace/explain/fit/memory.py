"""What other coefficients of a noise's memory could explain, taken from vectors as long as all residuals."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_ispace.explain.fit.directions import Directions


@dataclass(frozen=True)
class Memory:
    """Of one stream: its past in an orthonormal basis, in which each of its channels may be predicted otherwise.

    Attributes:
        channels: p. places: per run, where its numbers begin and end in the long vector, instants after each other.
        bases: per run, (instants, q) rows of the basis.
    """

    channels: int
    places: Sequence[tuple[int, int]]
    bases: Sequence[np.ndarray]

    def amounts(self, vectors: np.ndarray, start: int = 0) -> np.ndarray:
        """(m, p, q) of the basis in each channel of vectors (m, n) that begin at `start` and are zero elsewhere."""
        total = np.zeros((len(vectors), self.channels, self.bases[0].shape[1]))
        for (a, b), basis in zip(self.places, self.bases, strict=True):
            if start <= a and b <= start + vectors.shape[1]:
                part = vectors[:, a - start : b - start].reshape(len(vectors), len(basis), self.channels)
                total += np.tensordot(part, basis, axes=(1, 0))
        return total

    def take(self, vectors: np.ndarray) -> None:
        """Take what it could explain from vectors (m, n), in place."""
        amounts = self.amounts(vectors)
        for (a, b), basis in zip(self.places, self.bases, strict=True):
            part = np.tensordot(amounts, basis, axes=(2, 1)).transpose(0, 2, 1)
            vectors[:, a:b] -= part.reshape(len(vectors), -1)


def gram(memories: Sequence[Memory], directions: Directions) -> np.ndarray:
    """(k + q, k + q) products of directions from which every memory has taken its part."""
    found = directions.gram()
    for memory in memories:
        groups = [(0, directions.everywhere), *directions.own]
        amounts = np.concatenate([memory.amounts(part, start) for start, part in groups])
        found -= np.tensordot(amounts, amounts, axes=((1, 2), (1, 2)))
    return found
