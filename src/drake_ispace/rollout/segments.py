"""A rollout in segments: it stops at a tick, and goes on from there with other parameters or from another state."""

import numpy as np

from drake_ispace.rollout.compile import Rollout

State = tuple[np.ndarray, np.ndarray]  # continuous and discrete state, packed


class Segments:
    """Segments of a rollout along the same recorded inputs.

    Args:
        rollout: compiled. ticks: the last one. inputs: as `Rollout.run` takes them.

    Raises:
        InputError: an input that is missing or of a wrong shape.
    """

    def __init__(self, rollout: Rollout, ticks: int, inputs):
        self._function, self._recorded = rollout.opened(ticks, inputs)
        self.logs = {name: np.full((ticks + 1, size), np.nan) for name, (size, _) in rollout.logged.items()}

    def run(self, first: int, last: int, state: State, parameters: np.ndarray) -> dict[str, np.ndarray]:
        """Roll out from tick `first` to `last`; `state` is changed in place.

        Returns:
            name -> (ticks + 1, size) logs of all segments. Rows `first` to `last` are those of this segment, until
            another one overwrites them.
        """
        self._function(first, last, *state, parameters, self._recorded, *self.logs.values())
        return self.logs
