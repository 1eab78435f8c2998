"""Two named effects that undo each other are told."""

from types import SimpleNamespace

import numpy as np
import pytest

from drake_ispace.explain.answer.cancel import cancelling

ALIKE = {"one": np.array([1.0, 2.0, 0.0]), "other": np.array([1.0, 2.0, 0.05]), "unlike": np.array([0.0, 0.0, 3.0])}


def decided(sizes):
    """A Decision that names effects of these sizes; what each does to the residuals is in ALIKE."""
    candidates = {Named(name): [size] for name, size in sizes.items()}

    def whitened(point):
        return -sum((z[0] * ALIKE[candidate.name] for candidate, z in point.items()), np.zeros(3))

    likelihood = SimpleNamespace(whitened=whitened, deviance=lambda w: float(w @ w))
    named = SimpleNamespace(point=candidates, w=whitened(candidates))
    return SimpleNamespace(end=SimpleNamespace(likelihood=likelihood), named=named)


class Named:
    def __init__(self, name):
        self.name = name


@pytest.mark.parametrize("sizes, said", [
    ({"one": 2.0, "other": -2.0}, True), ({"one": 2.0, "other": -1.0}, False), ({"one": 2.0, "unlike": -1.0}, False),
    ({"one": 2.0}, False), ({"unlike": 1.0, "other": 2.0, "one": -2.0}, True),
])
def test_effects_that_do_nothing_together_are_told(sizes, said):
    sentences = cancelling(decided(sizes))
    assert len(sentences) == said and all("undo each other" in sentence for sentence in sentences)
