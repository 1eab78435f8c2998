"""Many runs of one Diagram at once, one to a SIMD lane: states, ports and parameters are laid out [element][lane].

What the emitted rollout does between two decisions about the tick becomes a loop over the lanes, of which each loads
the numbers of its lane into small vectors, calls the kernels unchanged, and puts back what they wrote. LLVM turns such
a loop into vector instructions unless a kernel in it has a loop that depends on data or calls the system's library
(functions.py takes the place of its sin, exp and so on); then it is run lane by lane. The operations of a lane are
those of a single run, so are its results, to the last bit.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numba
import numpy as np
from pydrake.systems.framework import Diagram

from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.kernels import is_small
from drake_ispace.rollout import views
from drake_ispace.rollout.compile import Rollout, check_ticks, compile_diagram, machine_code, rows_in
from drake_ispace.rollout.lane_text import text_for_lanes

LANES = 32


@dataclass(frozen=True)
class LaneRollout:
    """A Diagram compiled for `lanes` runs at once; made by `compile_lanes`.

    Attributes:
        single: the same Diagram, run by run: names and values of the parameters, what is logged.
        source: the text of the compiled function; lanes: runs at once.
        varied: (len(parameter_names),) which parameters may differ from those of the Context.
    """

    single: Rollout
    source: str
    lanes: int
    varied: np.ndarray = field(repr=False)
    _function: object = field(repr=False)

    def run(
        self, ticks: int, parameters, continuous_state=None, discrete_state=None,
        inputs: Mapping[str, np.ndarray] | None = None,
    ) -> dict[str, np.ndarray]:
        """Roll out once for every row of `parameters` (runs, len(parameter_names)), from tick 0.

        Args:
            ticks: length of every run.
            continuous_state, discrete_state: of all runs, or (runs, n) of each; default that of the Context.
            inputs: name of an exported input -> (ticks, size) for all runs, or (runs, ticks, size).

        Returns:
            name -> (runs, rows, size), run by run what `single.run` gives.

        Raises:
            InputError: a number of ticks that no clock holds, rows, states or inputs of a wrong shape or missing,
                another value of a parameter that is not varied.
        """
        check_ticks(ticks)
        single = self.single
        parameters = np.atleast_2d(np.asarray(parameters, dtype=float))
        if parameters.ndim != 2 or parameters.shape[1] != len(single.parameters):
            raise InputError(f"parameters: are an array {parameters.shape}, expected (runs, {len(single.parameters)})")
        fixed = ~self.varied & (parameters != single.parameters).any(axis=0)
        if fixed.any():
            name = single.parameter_names[int(np.argmax(fixed))]
            raise InputError(f"parameters: {name} has another value than it was compiled with, expected it in `varied`")
        runs = len(parameters)
        x = _of_each("continuous_state", continuous_state, single.continuous_state, runs)
        d = _of_each("discrete_state", discrete_state, single.discrete_state, runs)
        recorded = self._recorded(inputs or {}, ticks, runs)
        logs = {name: np.empty((runs, rows_in(ticks, by), size)) for name, (size, by) in single.logged.items()}
        for start in range(0, runs, self.lanes):
            chosen = np.minimum(np.arange(start, start + self.lanes), runs - 1)  # the last group repeats its last run
            rows = parameters[chosen]
            parts = [np.empty((*log.shape[1:], self.lanes)) for log in logs.values()]
            those = recorded[:, :, chosen] if recorded.shape[2] > 1 else np.repeat(recorded, self.lanes, axis=2)
            reached = np.full(self.lanes, ticks)
            laid = [np.ascontiguousarray(array) for array in (x[chosen].T, d[chosen].T, rows.T, rows, those)]
            self._function(0, ticks, *laid, reached, *parts)
            for (_, divisor), log, part in zip(single.logged.values(), logs.values(), parts, strict=True):
                group = log[start : start + self.lanes]
                group[:] = np.moveaxis(part, -1, 0)[: len(group)]
                for run in np.flatnonzero(reached[: len(group)] < ticks):
                    group[run, 0 if divisor is None else reached[run] // divisor + 1 :] = np.nan
        return logs

    def _recorded(self, inputs, ticks, runs):
        """(ticks, columns, 1) for all runs, or (ticks, columns, runs)."""
        each = {name for name, signal in inputs.items() if np.ndim(signal) == 3}
        for name in each:
            if len(inputs[name]) != runs:
                raise InputError(f"the signal of input {name!r} is of {len(inputs[name])} runs, expected {runs}")
        if not each:
            return self.single.packed(ticks, inputs)[:, :, None]
        by_run = ({n: s[run] if n in each else s for n, s in inputs.items()} for run in range(runs))
        return np.stack([self.single.packed(ticks, one) for one in by_run], axis=2)


def compile_lanes(
    diagram: Diagram, log: Mapping[str, int | None] | None = None, lanes: int = LANES,
    varied: Iterable[str] | None = None,
) -> LaneRollout:
    """Compile `diagram` for `lanes` runs at once; log: as of `compile_diagram`, varied: as of `lanes_of`.

    Raises:
        InputError: as `compile_diagram`, or a name in `varied` that no parameter has.
    """
    return lanes_of(compile_diagram(diagram, log=log), lanes, varied)


def lanes_of(single: Rollout, lanes: int = LANES, varied: Iterable[str] | None = None) -> LaneRollout:
    """Compile a Diagram, compiled for single runs, for `lanes` runs at once.

    varied: names of the parameters that may differ from run to run, default all. The others become constants, so that
    what they switch off costs nothing. Random streams always vary.

    Raises:
        InputError: there is no parameter of a name in `varied`.
    """
    names = single.parameter_names
    may_vary = np.array([varied is None or ".noise_stream[" in name for name in names], dtype=bool)
    for name in varied or ():
        may_vary[single.index(name)] = True
    long = {name for name, kernel in single.kernels.items() if not is_small(kernel.py_func)}
    text = text_for_lanes(single.source, lanes, single.parameters, may_vary, long)
    of_views = {name: getattr(views, name) for name in ("local", "matrix", "part", "column", "copied")}
    rows, cube = numba.float64[:, ::1], numba.float64[:, :, ::1]
    arguments = (numba.int64, numba.int64, rows, rows, rows, rows, cube, numba.int64[::1])
    function = machine_code(text, of_views | single.kernels, (*arguments, *[cube] * len(single.logged)), single.digest)
    return LaneRollout(single, text, lanes, may_vary, function)


def _of_each(name, values, default, runs):
    """(runs, n) states."""
    states = np.asarray(default if values is None else values, dtype=float)
    if states.shape not in (default.shape, (runs, *default.shape)):
        raise InputError(f"{name}: is an array {states.shape}, expected {default.shape} or {(runs, *default.shape)}")
    return np.broadcast_to(states, (runs, *default.shape))
