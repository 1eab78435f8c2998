"""Nuisances that are whitened run by run are the directions that they would be if kept whitened."""

from itertools import pairwise

import numpy as np
import pytest

from drake_ispace.explain.fit.offsets import members, offsets_of, stacks_of, stacks_of_runs
from drake_ispace.explain.fit.whitening import Whitening
from stand_ins.dense import Dense

RNG = np.random.default_rng(0)


def residuals(scale=1.0):
    """Of two runs, one of them without fixes."""
    return [
        {"motion": scale * np.cumsum(RNG.standard_normal((n, 2)), axis=0), "room": RNG.standard_normal((fixes, 3))}
        for n, fixes in ((900, 90), (700, 0))
    ]


MEASURED = residuals()
WHITENING = Whitening(MEASURED, [{"motion": RNG.integers(0, 4, n)} for n in (900, 700)])
EVERYWHERE, OWN = [residuals(0.2) for _ in range(3)], [(i, residuals()[i]) for i in (0, 0, 1)]
STARTS = WHITENING.starts(MEASURED)
FREED = RNG.standard_normal((2, STARTS[-1]))
STACKS = [stacks_of(EVERYWHERE[:2], MEASURED), stacks_of(EVERYWHERE[2:], MEASURED)], stacks_of_runs(OWN, MEASURED)
OFFSETS = offsets_of(WHITENING, MEASURED, *STACKS).with_freed(FREED)
NOTHING = [{name: 0.0 * rows for name, rows in run.items()} for run in MEASURED]
#: The same with whitened vectors that are all kept.
KEPT = Dense(np.vstack([
    *(WHITENING(change) for change in EVERYWHERE),
    *(WHITENING([change if j == i else none for j, none in enumerate(NOTHING)]) for i, change in OWN),
    FREED,
]))


def test_products_and_sums_are_those_of_vectors_that_are_kept():
    vectors, amounts = RNG.standard_normal((4, STARTS[-1])), RNG.standard_normal((4, len(KEPT)))
    assert len(OFFSETS) == len(KEPT) == 8
    assert OFFSETS.dot(vectors) == pytest.approx(KEPT.dot(vectors), rel=1e-9)
    assert OFFSETS.dot(vectors[0]) == pytest.approx(KEPT.dot(vectors[0]), rel=1e-9)
    assert OFFSETS.combined(amounts) == pytest.approx(KEPT.combined(amounts), rel=1e-9, abs=1e-12)
    assert OFFSETS.combined(amounts[0]) == pytest.approx(KEPT.combined(amounts[0]), rel=1e-9, abs=1e-12)


def test_the_gram_matrix_and_the_amounts_of_a_memory_are_those_of_vectors_that_are_kept():
    memories, every = WHITENING.memory(MEASURED), KEPT.vectors
    gram, amounts = OFFSETS.gram_and_amounts(memories)
    assert gram == pytest.approx(every @ every.T, rel=1e-9, abs=1e-9)
    for memory, found in zip(memories, amounts, strict=True):
        assert found == pytest.approx(memory.amounts(every), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("empty", [0, 1, 2])
def test_a_run_in_which_nothing_is_scored_takes_no_others_place(empty):
    runs = residuals()
    runs.insert(empty, {name: rows[:0] for name, rows in runs[0].items()})
    whitening = Whitening(runs, [{} for _ in runs])
    changes = [[{name: RNG.standard_normal(rows.shape) for name, rows in run.items()} for run in runs] for _ in "ab"]
    own = [(i, run) for i, run in enumerate(changes[0])]
    offsets = offsets_of(whitening, runs, [stacks_of(changes, runs)], stacks_of_runs(own, runs))
    starts = whitening.starts(runs)
    for i, (start, end) in enumerate(pairwise(starts)):
        part = offsets.part(start, end)
        whitened = [whitening(change)[start:end] for change in changes]
        assert part.rows == pytest.approx(np.array([*whitened, whitened[0]]))
        assert i == empty or part.places.tolist() == [0, 1, 2 + i]


def test_members_of_a_stack_share_its_memory():
    _, own = STACKS
    assert [len(members(stack)) for stack in own] == [2, 1]
    assert members(own[0])[1]["motion"] == pytest.approx(OWN[1][1]["motion"])
    assert np.shares_memory(members(own[0])[1]["motion"], own[0]["motion"])
