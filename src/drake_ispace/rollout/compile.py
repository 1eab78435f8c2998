"""A Diagram as one machine-code function."""

import hashlib
import inspect
import linecache
import os
import platform
import shutil
import uuid
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numba
import numpy as np
from pydrake.systems.framework import Context, Diagram

from drake_ispace.block import cache_folder
from drake_ispace.errors import InputError, expected_one_of, shown
from drake_ispace.noise import stream
from drake_ispace.rollout import views
from drake_ispace.rollout.emit import Emitter, Layout
from drake_ispace.rollout.network import Network, Port, take_apart


@dataclass(frozen=True)
class Rollout:
    """A compiled Diagram; made by `compile_diagram`.

    Attributes:
        source: the text of the compiled function.
        parameter_names: one per float, "block.parameter", "block.group.key" or "block.vector[i]".
        parameters: (len(parameter_names),) the values in the Context.
        continuous_state, discrete_state: packed initial state in the Context.
        logged: name -> (size, divisor in ticks).
        kernels: name in the text -> kernel.
    """

    source: str
    parameter_names: list[str]
    parameters: np.ndarray
    continuous_state: np.ndarray
    discrete_state: np.ndarray
    logged: dict[str, tuple[int, int]]
    kernels: dict[str, object] = field(repr=False)
    _function: object = field(repr=False)
    _network: Network = field(repr=False)
    _layout: Layout = field(repr=False)

    def run(
        self, ticks: int, parameters=None, continuous_state=None, discrete_state=None, inputs=None,
    ) -> dict[str, np.ndarray]:
        """Roll out over `ticks` from tick 0.

        Args:
            parameters, continuous_state, discrete_state: other than those of the Context.
            inputs: name of an exported input -> (ticks, size), held from its tick on.

        Returns:
            name -> (ticks // divisor + 1, size): row r is the value before the updates of tick r * divisor, as in a
            log of Drake's Simulator. Rows after a state that is no number are NaN.

        Raises:
            InputError: inputs that are missing or too short.
        """
        logs = {
            name: np.full((ticks // divisor + 1, size), np.nan) for name, (size, divisor) in self.logged.items()
        }
        x = np.array(self.continuous_state if continuous_state is None else continuous_state, dtype=float)
        d = np.array(self.discrete_state if discrete_state is None else discrete_state, dtype=float)
        p = np.ascontiguousarray(self.parameters if parameters is None else parameters, dtype=float)
        self._function(0, ticks, x, d, p, self._recorded(inputs or {}, ticks), *logs.values())
        return logs

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
            return self.parameter_names.index(name)
        except ValueError:
            known = expected_one_of(name, self.parameter_names)
            raise InputError(f"there is no parameter {shown(name)}, {known}") from None

    def with_seed(self, seed: int, parameters=None) -> np.ndarray:
        """The parameters with every random stream under another seed."""
        values = np.array(self.parameters if parameters is None else parameters, dtype=float)
        for name, leaf in self._network.leaves.items():
            if leaf.spec.noise_stream is not None:
                start = self.index(f"{name}.noise_stream[0]")
                values[start : start + 2] = stream(seed, leaf.spec.noise_stream)
        return values

    def _recorded(self, inputs, ticks):
        if unknown := set(inputs) - set(self._network.inputs):
            raise InputError(f"there is no exported input {shown(unknown.pop())}")
        columns = []
        for name, size in self._network.inputs.items():
            if name not in inputs:
                raise InputError(f"the exported input {shown(name)} has no signal, expected an array ({ticks}, {size})")
            signal = np.asarray(inputs[name], dtype=float).reshape(-1, size)
            if len(signal) < ticks:
                raise InputError(f"the signal of input {shown(name)} has {len(signal)} rows, expected {ticks}")
            columns.append(signal[:ticks])
        return np.ascontiguousarray(np.hstack(columns)) if columns else np.empty((0, 0))


def compile_diagram(diagram: Diagram, context: Context | None = None, log: Mapping[str, int] | None = None) -> Rollout:
    """Compile `diagram` with the parameters and the state of `context`.

    Args:
        diagram: of Blocks and Drake's primitives, nested or not.
        context: the Diagram's own, default a new one.
        log: name -> divisor in ticks; a name is an exported output or "block.port". Default: all outputs, every tick.

    Raises:
        InputError: a system that a compiled rollout does not know, an unconnected input, no signal of a name.
    """
    network = take_apart(diagram, context if context is not None else diagram.CreateDefaultContext())
    log = log or dict.fromkeys(network.outputs, 1)
    wanted = {name: (_find(network, name), divisor) for name, divisor in log.items()}
    emitter = Emitter(network, wanted)
    leaves = network.leaves

    def packed(attribute):
        return np.concatenate([np.empty(0), *(getattr(leaf, attribute) for leaf in leaves.values())])

    return Rollout(
        source=emitter.source,
        parameter_names=[f"{name}.{p}" for name, leaf in leaves.items() for p in leaf.spec.parameter_names],
        parameters=packed("parameters"), continuous_state=packed("continuous_state"),
        discrete_state=packed("discrete_state"),
        logged={name: (network.source_size(port), divisor) for name, (port, divisor) in wanted.items()},
        kernels=emitter.kernels, _function=_machine_code(emitter), _network=network, _layout=emitter.layout,
    )


def _find(network: Network, name: str) -> Port:
    if name in network.outputs:
        return network.outputs[name]
    block, _, port = name.rpartition(".")
    if block in network.leaves and port in network.leaves[block].spec.outputs:
        return Port(block, port)
    known = [*network.outputs, *(f"{b}.{p}" for b, leaf in network.leaves.items() for p in leaf.spec.outputs)]
    raise InputError(f"there is no signal {shown(name)}, {expected_one_of(name, known)}")


def _machine_code(emitter: Emitter):
    """The compiled function, from the disk where it has been compiled before; damaged entries are made anew."""
    digest = hashlib.sha256(emitter.source.encode())
    for name, kernel in sorted(emitter.kernels.items()):
        digest.update(f"{name}={kernel.digest}".encode())
    digest.update(inspect.getsource(views).encode())
    digest.update(f"{numba.__version__} {np.__version__} {platform.machine()}".encode())
    folder = cache_folder() / "rollouts" / digest.hexdigest()[:24]
    try:
        return _load(emitter, folder)
    except Exception:  # whatever a damaged cache entry raises: nothing in it is needed
        shutil.rmtree(folder, ignore_errors=True)
        return _load(emitter, folder)


def _load(emitter: Emitter, folder: Path):
    file = folder / "rollout.py"
    if not file.is_file() or file.read_text() != emitter.source:
        folder.mkdir(parents=True, exist_ok=True)
        beside = folder / f"{uuid.uuid4().hex}.part"
        beside.write_text(emitter.source)
        os.replace(beside, file)
    names = {"np": np, "local": views.local, "part": views.part, **emitter.kernels}
    # numba finds a cached function again through the name of a module that can be imported
    names |= {"__name__": __name__, "__file__": str(file)}
    exec(compile(emitter.source, str(file), "exec"), names)
    linecache.checkcache(str(file))
    saved = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder)
    try:
        function = numba.njit(cache=True, nogil=True, error_model="numpy")(names["rollout"])
    finally:
        numba.config.CACHE_DIR = saved
    row, rows = numba.float64[::1], numba.float64[:, ::1]
    function.compile((numba.int64, numba.int64, row, row, row, rows, *[rows] * len(emitter._log)))
    return function
