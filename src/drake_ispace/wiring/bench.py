"""A small wiring bench: blocks by name, wires by "block.port"; and a robot's part of it."""

from collections.abc import Sequence

from pydrake.systems.framework import Diagram, DiagramBuilder, System


class Bench:
    """Collects blocks, wires and outputs of a Diagram.

    Raises (from its methods):
        RuntimeError: from Drake, for a port that does not exist or is connected twice.
    """

    def __init__(self):
        self._builder = DiagramBuilder()
        self._blocks: dict[str, System] = {}
        self._wires: list[tuple[str, str]] = []

    def add(self, name: str, block: System) -> System:
        """Add `block` under `name`."""
        block.set_name(name)
        self._blocks[name] = self._builder.AddSystem(block)
        return block

    def wire(self, *pairs: tuple[str, str]) -> None:
        """Connect each ("block.output", "block.input")."""
        self._wires += pairs

    def source(self, target: str) -> str:
        """Where the wire that ends at `target` comes from."""
        (found,) = {source for source, end in self._wires if end == target}
        return found

    def splice(self, targets: list[str], name: str, block: System, port: str) -> None:
        """Put `block` into the one wire that ends at `targets`: in and out by its ports called `port`."""
        self.add(name, block)
        (source,) = {source for source, end in self._wires if end in targets}
        self._wires = [(source, end) for source, end in self._wires if end not in targets]
        self.wire((source, f"{name}.{port}"), *[(f"{name}.{port}", target) for target in targets])

    def show(self, **ports: str) -> None:
        """Export outputs of the Diagram: signal="block.output"."""
        for signal, port in ports.items():
            self._builder.ExportOutput(self._output(port), signal)

    def let_in(self, **ports: str) -> None:
        """Export inputs of the Diagram: signal="block.input"."""
        for signal, port in ports.items():
            self._builder.ExportInput(self._input(port), signal)

    def build(self, name: str) -> Diagram:
        for source, target in self._wires:
            self._builder.Connect(self._output(source), self._input(target))
        diagram = self._builder.Build()
        diagram.set_name(name)
        return diagram

    def _output(self, port):
        block, _, name = port.rpartition(".")
        return self._blocks[block].GetOutputPort(name)

    def _input(self, port):
        block, _, name = port.rpartition(".")
        return self._blocks[block].GetInputPort(name)


class Part:
    """The blocks of one robot on a Bench: "plant" stands for "omni_plant" where the robot is called omni.

    Attributes:
        takes_fix: the robot's inputs to which the room's fix goes.
    """

    def __init__(self, bench: Bench, name: str, takes_fix: Sequence[str] = ()):
        self.bench, self.name, self.takes_fix = bench, name, list(takes_fix)

    def block(self, name: str) -> str:
        """The name of the robot's block, or "block.port", on the whole Bench."""
        return f"{self.name}_{name}"

    def add(self, name: str, block: System) -> System:
        """Add `block` under the robot's `name`."""
        return self.bench.add(self.block(name), block)

    def wire(self, *pairs: tuple[str, str]) -> None:
        """Connect each ("block.output", "block.input"), both of this robot."""
        self.bench.wire(*[(self.block(source), self.block(target)) for source, target in pairs])

    def show(self, **ports: str) -> None:
        """Export outputs of the Diagram: signal="block.output", named "robot_signal"."""
        self.bench.show(**{self.block(signal): self.block(port) for signal, port in ports.items()})
