"""A Diagram as one machine-code function."""

import gc
import hashlib
import inspect
import linecache
import os
import platform
import shutil
import uuid
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numba
import numba.core.errors
import numpy as np
from pydrake.systems.framework import Context, Diagram

from drake_ispace.blocks.block import Spec
from drake_ispace.blocks.errors import InputError, expected_one_of, shown
from drake_ispace.blocks.kernels import cache_folder, jitted
from drake_ispace.blocks.noise import stream
from drake_ispace.blocks.rates import MAX_TICK
from drake_ispace.rollout import views
from drake_ispace.rollout.emit import Emitter
from drake_ispace.rollout.network import Network, Port, take_apart, with_blocks


@dataclass(frozen=True)
class Rollout:
    """A compiled Diagram; made by `compile_diagram`.

    Attributes:
        source: the text of the compiled function.
        parameter_names: one per float, "block.parameter", "block.group.key" or "block.vector[i]".
        parameters: (len(parameter_names),) the values in the Context.
        continuous_state, discrete_state: packed initial state in the Context.
        logged: name -> (size, divisor in ticks, or None for the last tick only).
        kernels: name in the text -> kernel.
        digest: of the text and the kernels; another one may give other numbers.
    """

    source: str
    parameter_names: list[str]
    parameters: np.ndarray
    continuous_state: np.ndarray
    discrete_state: np.ndarray
    logged: dict[str, tuple[int, int]]
    kernels: dict[str, object] = field(repr=False)
    digest: str
    _function: object = field(repr=False)
    _network: Network = field(repr=False)

    def run(
        self, ticks: int, parameters=None, continuous_state=None, discrete_state=None, inputs=None,
    ) -> dict[str, np.ndarray]:
        """Roll out over `ticks` from tick 0.

        Args:
            parameters, continuous_state, discrete_state: other than those of the Context.
            inputs: name of an exported input -> (ticks, size), held from its tick on; or all of them, `packed`.

        Returns:
            name -> (ticks // divisor + 1, size), or (1, size) where only the last tick is logged: row r is the value
            before the updates of tick r * divisor, as in a log of Drake's Simulator. A run ends at most 256 ticks after
            an element of the continuous state is no number; its later rows are NaN. Without a continuous state it never
            ends early.

        Raises:
            InputError: ticks, parameters, states or inputs of a wrong number, or inputs that are missing.
        """
        check_ticks(ticks)
        x = _own("continuous_state", continuous_state, self.continuous_state)
        d = _own("discrete_state", discrete_state, self.discrete_state)
        p = _own("parameters", parameters, self.parameters)
        recorded = self.packed(ticks, {} if inputs is None else inputs)
        logs = {
            name: np.full((rows_in(ticks, divisor), size), np.nan) for name, (size, divisor) in self.logged.items()
        }
        self._function(0, ticks, x, d, p, recorded, *logs.values())
        return logs

    def opened(self, ticks: int, inputs: Mapping[str, np.ndarray] | np.ndarray):
        """The machine code, and the inputs in the form that it takes; errors as `run`."""
        return self._function, self.packed(ticks, inputs)

    def packed(self, ticks: int, inputs: Mapping[str, np.ndarray] | np.ndarray) -> np.ndarray:
        """(ticks, columns) inputs in the form that the machine code takes, which they may have already.

        For several runs along the same inputs. Errors as `run`.
        """
        check_ticks(ticks)
        if isinstance(inputs, np.ndarray):
            size = sum(self._network.inputs.values())
            if inputs.shape != (ticks, size):
                raise InputError(f"the packed inputs are an array {inputs.shape}, expected ({ticks}, {size})")
            return inputs
        if unknown := set(inputs) - set(self._network.inputs):
            raise InputError(f"there is no exported input {shown(unknown.pop())}")
        columns = []
        for name, size in self._network.inputs.items():
            if name not in inputs:
                raise InputError(f"the exported input {shown(name)} has no signal, expected an array ({ticks}, {size})")
            signal = np.asarray(inputs[name], dtype=float)
            if signal.ndim == 1 and size == 1:
                signal = signal[:, None]
            if signal.ndim != 2 or signal.shape[1] != size:
                raise InputError(
                    f"the signal of input {shown(name)} is an array {signal.shape}, expected ({ticks}, {size})"
                )
            if len(signal) < ticks:
                raise InputError(f"the signal of input {shown(name)} has {len(signal)} rows, expected {ticks}")
            columns.append(signal[:ticks])
        return np.ascontiguousarray(np.hstack(columns)) if columns else np.empty((0, 0))

    @property
    def inputs(self) -> dict[str, int]:
        """Exported inputs of the Diagram -> size."""
        return self._network.inputs

    def with_parameters(self, changes: Mapping[str, float]) -> np.ndarray:
        """The parameters with some set by name.

        Raises:
            InputError: no parameter of that name.
        """
        values = self.parameters.copy()
        for name, value in changes.items():
            values[self.index(name)] = value
        return values

    def index(self, name: str) -> int:
        """Where the parameter `name` lies.

        Raises:
            InputError: no parameter of that name.
        """
        try:
            return self._places[name]
        except KeyError:
            known = expected_one_of(name, self.parameter_names)
            raise InputError(f"there is no parameter {shown(name)}, {known}") from None

    @cached_property
    def _places(self):
        return {name: i for i, name in enumerate(self.parameter_names)}

    def with_seed(self, seed: int, parameters=None) -> np.ndarray:
        """The parameters with every random stream under another seed."""
        values = np.array(self.parameters if parameters is None else parameters, dtype=float)
        for name, leaf in self._network.leaves.items():
            if leaf.spec.noise_stream is not None:
                start = self.index(f"{name}.noise_stream[0]")
                values[start : start + 2] = stream(seed, leaf.spec.noise_stream)
        return values


def compile_diagram(
    diagram: Diagram, context: Context | None = None, log: Mapping[str, int | None] | None = None,
    added: Mapping[str, tuple[Spec, Mapping[str, str]]] | None = None,
) -> Rollout:
    """Compile `diagram` with the parameters and the state of `context`.

    Args:
        diagram: of Blocks and Drake's primitives, nested or not.
        context: the Diagram's own, default a new one.
        log: name -> divisor in ticks, or None for the last tick only; a name is an exported output or "block.port".
            Default: all outputs, every tick.
        added: blocks that read outputs of the Diagram, name -> (Spec, input -> output's name).

    Raises:
        InputError: a system that a compiled rollout does not know, an unconnected input, no signal of a name, a
            divisor that is no number of ticks.
    """
    network, wanted, emitter = _emitted(diagram, context, log, added or {})
    leaves, digest = network.leaves, _digest(emitter)

    def packed(attribute):
        return np.concatenate([np.empty(0), *(getattr(leaf, attribute) for leaf in leaves.values())])

    return Rollout(
        source=emitter.source,
        parameter_names=[f"{name}.{p}" for name, leaf in leaves.items() for p in leaf.spec.parameter_names],
        parameters=packed("parameters"), continuous_state=packed("continuous_state"),
        discrete_state=packed("discrete_state"),
        logged={name: (network.source_size(port), divisor) for name, (port, divisor) in wanted.items()},
        kernels=emitter.kernels, digest=digest, _function=_of_single_runs(emitter, digest), _network=network,
    )


def kernel_text(diagram: Diagram) -> str:
    """`Rollout.source` without compiling anything, every output logged; errors as `compile_diagram`."""
    return _emitted(diagram, None, None, {})[2].source


def _emitted(diagram, context, log, added) -> tuple[Network, dict[str, tuple[Port, int]], Emitter]:
    network = take_apart(diagram, context if context is not None else diagram.CreateDefaultContext())
    network = with_blocks(network, added)
    wanted = {}
    for name, divisor in (dict.fromkeys(network.outputs, 1) if log is None else log).items():
        whole = isinstance(divisor, int | np.integer) and not isinstance(divisor, bool)
        if divisor is not None and not (whole and divisor >= 1):
            raise InputError(f"log {shown(name)} has divisor {shown(divisor)}, expected a whole number from 1 on")
        wanted[name] = (_find(network, name), None if divisor is None else int(divisor))
    return network, wanted, Emitter(network, wanted)


def rows_in(ticks: int, divisor: int | None) -> int:
    """Return how many rows a log has."""
    return 1 if divisor is None else ticks // divisor + 1


def check_ticks(ticks: int) -> None:
    """Refuse a length that is negative or longer than the clock is exact.

    Raises:
        InputError: it is.
    """
    if not 0 <= ticks <= MAX_TICK:
        raise InputError(f"a run of {ticks} ticks, expected 0 to {MAX_TICK}")


def _own(name, values, default):
    """A copy that the compiled function may write to, of the size that it takes for granted."""
    own = np.array(default if values is None else values, dtype=float)
    if own.shape != default.shape:
        raise InputError(f"{name}: is an array {own.shape}, expected {default.shape}")
    return own


def _find(network: Network, name: str) -> Port:
    if name in network.outputs:
        return network.outputs[name]
    block, _, port = name.rpartition(".")
    if block in network.leaves and port in network.leaves[block].spec.outputs:
        return Port(block, port)
    known = [*network.outputs, *(f"{b}.{p}" for b, leaf in network.leaves.items() for p in leaf.spec.outputs)]
    raise InputError(f"there is no signal {shown(name)}, {expected_one_of(name, known)}")


def _digest(emitter: Emitter) -> str:
    digest = hashlib.sha256(emitter.source.encode())
    for name, kernel in sorted(emitter.kernels.items()):
        digest.update(f"{name}={kernel.digest}".encode())
    return digest.hexdigest()


def _of_single_runs(emitter, digest):
    row, rows = numba.float64[::1], numba.float64[:, ::1]
    of_views = {name: getattr(views, name) for name in ("local", "part", "row", "copied")}
    arguments = (numba.int64, numba.int64, row, row, row, rows, *[rows] * len(emitter._log))
    return machine_code(emitter.source, of_views | emitter.kernels, arguments, digest)


def machine_code(source: str, names: Mapping[str, object], arguments: Sequence, digest: str):
    """Compile the function `rollout` of a text, or take it from the disk where it has been compiled before.

    Args:
        source: the text. names: what it uses besides NumPy. arguments: types of its arguments. digest: of the kernels.
    """
    if (rollouts := cache_folder("rollouts")) is None:
        return _load(source, names, arguments, None)
    key = f"{digest} {source} {inspect.getsource(views)} {numba.__version__} {np.__version__} {platform.machine()}"
    folder = rollouts / hashlib.sha256(key.encode()).hexdigest()[:24]
    try:
        return _load(source, names, arguments, folder)
    except (numba.core.errors.NumbaError, SyntaxError):
        raise
    except Exception:  # whatever a damaged cache entry raises: nothing in it is needed
        shutil.rmtree(folder, ignore_errors=True)
    try:
        return _load(source, names, arguments, folder)
    except OSError:  # a full disk
        return _load(source, names, arguments, None)


def _load(source: str, names: Mapping[str, object], arguments: Sequence, folder: Path | None):
    """Compile, or take from `folder` (None: kept nowhere)."""
    file = "<rollout>" if folder is None else _written(source, folder)
    # numba finds a cached function again through the name of a module that can be imported
    names = {"np": np, **names, "__name__": __name__, "__file__": str(file)}
    exec(compile(source, str(file), "exec"), names)
    linecache.checkcache(str(file))
    function = jitted(names["rollout"], folder, nogil=True, error_model="numpy")
    with _no_collection():
        function.compile(tuple(arguments))
    function.disable_compile()  # arrays of another kind are refused instead of compiled for
    return function


@contextmanager
def _no_collection() -> Iterator[None]:
    """Python's collector takes an eighth of the time of compiling, and gives back some 80 MB."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


def _written(source: str, folder: Path) -> Path:
    file = folder / "rollout.py"
    if not file.is_file() or file.read_text() != source:
        folder.mkdir(parents=True, exist_ok=True)
        beside = folder / f"{uuid.uuid4().hex}.part"
        beside.write_text(source)
        os.replace(beside, file)
    return file
