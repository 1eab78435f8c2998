"""A replay that was stopped at some ticks: a run that is another one from one of them on begins there."""

from collections.abc import Iterable

import numpy as np

from drake_ispace.explain.predict.replay import Replay
from drake_ispace.explain.predict.room_view import LEAD_TICKS
from drake_ispace.explain.predict.tracks import Track
from drake_ispace.rollout.segments import Segments, State


class Begun:
    """The replay of a run, with its state at some ticks.

    Args:
        replay: compiled. run: replayed. start: (3 + n,) pose and wheel angles at t = 0. numbers: the rollout's run-time
            numbers. ticks: at which other runs may begin.
    """

    def __init__(self, replay: Replay, run: Track, start: np.ndarray, numbers: np.ndarray, ticks: Iterable[int]):
        self._replay, self._start, self._given = replay, start, numbers
        self._numbers = replay.since(run, numbers)
        self._last = run.ticks + LEAD_TICKS
        self._states: dict[int, State] = {}
        if not replay.may_begin_late:
            return
        segments = Segments(replay.rollout, self._last, replay.packed(run, self._numbers, replay.logged_inputs))
        state, at = (replay.state(start, self._numbers), replay.rollout.discrete_state.copy()), 0
        for tick in sorted({*ticks}):
            segments.run(at, tick, state, self._numbers)
            self._states[tick], at = tuple(part.copy() for part in state), tick
        self._logs = segments.logs

    def run(self, other: Track, since: int) -> tuple[np.ndarray, np.ndarray]:
        """What `Replay.run` gives of `other`, whose inputs are those of the run at all ticks before `since`."""
        if not self._replay.may_begin_late:
            return self._replay.run(other, self._start, self._given)
        inputs = self._replay.packed(other, self._numbers, self._replay.logged_inputs)
        segments = Segments(self._replay.rollout, self._last, inputs)
        for name, rows in segments.logs.items():
            rows[:since] = self._logs[name][:since]
        logs = segments.run(since, self._last, tuple(part.copy() for part in self._states[since]), self._numbers)
        return self._replay.shown(other, logs)
