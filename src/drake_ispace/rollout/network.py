"""A Diagram taken apart: its leaves as Specs with initial values, and who feeds whom, nested Diagrams opened."""

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numba.core.dispatcher import Dispatcher
from pydrake.systems.framework import Context, Diagram, InputPortIndex, OutputPortIndex, System
from pydrake.systems.primitives import VectorLogSink

from drake_ispace.blocks.block import Spec
from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.kernels import arguments
from drake_ispace.rollout.primitives import specification


@dataclass(frozen=True)
class Port:
    """An output port of a leaf, or an input port of the whole Diagram (`leaf` None)."""

    leaf: str | None
    name: str


@dataclass(frozen=True)
class Leaf:
    """A leaf system: its Spec, the values its Context holds, and the source of every input port."""

    name: str
    spec: Spec
    parameters: np.ndarray
    continuous_state: np.ndarray
    discrete_state: np.ndarray
    sources: dict[str, Port]


@dataclass(frozen=True)
class Network:
    """The leaves in the Diagram's order, the outputs and the inputs of the whole Diagram (input name -> size)."""

    leaves: dict[str, Leaf]
    outputs: dict[str, Port]
    inputs: dict[str, int]

    def source_size(self, port: Port) -> int:
        return self.inputs[port.name] if port.leaf is None else self.leaves[port.leaf].spec.outputs[port.name].size


def take_apart(diagram: Diagram, context: Context) -> Network:
    """The Network of `diagram` with the values of `context`.

    Raises:
        InputError: a system that a compiled rollout does not know, or an input port that nothing feeds.
    """
    return _Opened(diagram, context).network


def with_blocks(network: Network, blocks: Mapping[str, tuple[Spec, Mapping[str, str]]]) -> Network:
    """A Network with blocks of discrete state beside it, each fed by outputs of the whole: input -> output's name."""
    added = {
        name: Leaf(
            name, spec, spec.parameter_values, np.empty(0), np.asarray(spec.discrete_state, dtype=float),
            {own: network.outputs[output] for own, output in inputs.items()},
        )
        for name, (spec, inputs) in blocks.items()
    }
    return Network(network.leaves | added, network.outputs, network.inputs)


_ADDRESS = re.compile(r"@[0-9a-f]{16}$")  # at the end of the name that Drake gives to a system without one


class _Opened:
    """A Diagram on its way to a Network."""

    def __init__(self, diagram: Diagram, context: Context):
        self._types: Counter[str] = Counter()
        self._own_names: dict[str, str] = {}  # name that holds an address -> one that is the same in every process
        self._name_unnamed(diagram)
        self._leaves: dict[str, Leaf] = {}
        inputs = {}
        for i in range(diagram.num_input_ports()):
            inputs[self._named(diagram.get_input_port(i))] = diagram.get_input_port(i).size()
        self._open(diagram, context, "", {i: Port(None, name) for i, name in enumerate(inputs)})
        outputs = {}
        for i in range(diagram.num_output_ports()):
            outputs[self._named(diagram.get_output_port(i))] = self._source(diagram, i, "")
        self.network = Network(self._leaves, outputs, inputs)

    def _name_unnamed(self, diagram):
        """Type and number for every system that has no name of its own."""
        for system in diagram.GetSystems():
            if _ADDRESS.search(system.get_name()):
                kind = type(system).__name__
                self._types[kind] += 1
                self._own_names[system.get_name()] = f"{kind}_{self._types[kind]}"
            if isinstance(system, Diagram):
                self._name_unnamed(system)

    def _named(self, item):
        """The name of a system, or of an exported port, which may hold that of its system."""
        name = item.get_name()
        if "@" in name:
            for address, own in self._own_names.items():
                name = name.replace(address, own)
        return name

    def _open(self, diagram, context, prefix, fed):
        """Add the leaves of `diagram`; `fed`: what feeds each of its own input ports."""
        wires: dict[tuple[System, int], Port] = {}
        for (target, port), (source, out) in diagram.connection_map().items():
            wires[target, int(port)] = self._output(source, int(out), prefix)
        for i in range(diagram.num_input_ports()):
            for target, port in diagram.GetInputPortLocators(InputPortIndex(i)):
                wires[target, int(port)] = fed.get(i)
        for system in diagram.GetSystems():
            if isinstance(system, VectorLogSink):
                continue
            path = prefix + self._named(system)
            feeds = {i: wires.get((system, i)) for i in range(system.num_input_ports())}
            own = diagram.GetSubsystemContext(system, context)
            if isinstance(system, Diagram):
                self._open(system, own, f"{path}/", feeds)
            elif path in self._leaves:
                raise InputError(f"two systems are called {path}, expected one of that name")
            else:
                self._leaves[path] = _leaf(system, own, path, feeds)

    def _output(self, system, index, prefix) -> Port:
        path = prefix + self._named(system)
        if isinstance(system, Diagram):
            return self._source(system, index, f"{path}/")
        return Port(path, system.get_output_port(index).get_name())

    def _source(self, diagram, index, prefix) -> Port:
        system, out = diagram.get_output_port_locator(OutputPortIndex(index))
        return self._output(system, int(out), prefix)


def _leaf(system, context, path, feeds) -> Leaf:
    spec = getattr(system, "spec", None)
    if not isinstance(spec, Spec):
        spec = specification(system, context, path)
        parameters = spec.parameter_values
    else:
        if not all(isinstance(function, Dispatcher) for function in _kernels(spec)):
            raise InputError(
                f"{path}: the maths of {type(system).__name__} are no kernels, so it cannot be compiled; expected a "
                "Diagram without it, or Drake's own Simulator"
            )
        for function in _kernels(spec):
            if not hasattr(function, "digest"):
                raise InputError(
                    f"{path}: {function.__name__} is compiled with numba.njit alone, expected @kernel of kernels.py, "
                    "which knows when it has changed"
                )
        parameters = context.get_numeric_parameter(0).CopyToVector()
    sources = {}
    read = {name for function in _kernels(spec) for name in arguments(function)}
    for i, name in enumerate(spec.inputs):
        if feeds.get(i) is not None:
            sources[name] = feeds[i]
        elif name in read:
            raise InputError(f"{path}: nothing feeds the input port {name!r}, expected it to be connected or exported")
    state = context.get_continuous_state_vector().CopyToVector() if spec.derivatives else np.empty(0)
    memory = context.get_discrete_state_vector().CopyToVector() if spec.discrete_state is not None else np.empty(0)
    return Leaf(path, spec, parameters, state, memory, sources)


def _kernels(spec):
    yield from (output.kernel for output in spec.outputs.values())
    yield from (update.kernel for update in spec.updates)
    if spec.derivatives is not None:
        yield spec.derivatives
