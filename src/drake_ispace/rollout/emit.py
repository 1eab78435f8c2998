"""From a Network to the text of one Python function that does what Drake's Simulator does with the Diagram.

Per tick k: log x-; sense (every update on the state before the phase, then all stored); compute (likewise); one step of
Drake's fixed-step Runge-Kutta 3. Outputs are evaluated where they are needed, in the order of direct feed-through, and
again only when something they depend on has changed. docs/semantics.md.
"""

import itertools
import re
from contextlib import contextmanager
from dataclasses import dataclass, field

from drake_ispace.blocks.block import Phase, Update
from drake_ispace.blocks.kernels import arguments
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.rollout.layout import layout_of, parameter_sizes
from drake_ispace.rollout.network import Network, Port

_CHECK_TICKS = 256  # between looks for a state that is no number
_LONGEST_COPY = 64  # floats; a longer parameter, a path's table, is read where it lies
_LARGEST_LOCAL = 1024  # floats; LLVM takes minutes over a longer vector on the stack
#: What the text says itself. Names that begin with "log_" are those of logs, with "lanes_" those of lane_text.py.
_RESERVED = frozenset(
    "np local part matrix row copied empty k i h h6 x d p first last reached finite recorded range rollout lane rows"
    " min".split()
)


@dataclass
class _Code:
    """Lines, and what is up to date at this point of them."""

    lines: list[str]
    fresh: set = field(default_factory=set)
    depth: int = 2

    def add(self, line: str) -> None:
        self.lines.append("    " * self.depth + line)

    def copy(self, size: int, source: str, target: str, first: int = 0, at: int = 0) -> None:
        """`size` floats of `source` from its number `first` on, to `target` from its number `at` on."""
        self.add(f"copied({source}, {first}, {size}, {target}, {at})")

    @contextmanager
    def inside(self, condition: str | None):
        """The code below `if condition`; what it evaluates does not count outside."""
        if condition is None:
            yield self
            return
        inner = _Code([], set(self.fresh), self.depth + 1)
        yield inner
        if inner.lines:
            self.add(f"if {condition}:")
            self.lines += inner.lines


class Emitter:
    """Writes the function for a Network.

    Attributes:
        source: its text; kernels: name in the text -> kernel; layout: of the packed vectors.
    """

    def __init__(self, network: Network, log: dict[str, tuple[Port, int | None]]):
        """`log`: name of a logged signal -> (port, its divisor in ticks; None: the last tick only)."""
        self._network = network
        self._log = log
        self._names: dict[object, str] = {}
        self._taken = set(_RESERVED)
        self.kernels: dict[str, object] = {}
        self.layout = layout_of(network)
        self._dependencies: dict[object, frozenset] = {}
        self.source = self._write()

    # -- the function as a whole -----------------------------------------------------------------------------------

    def _write(self) -> str:
        body = _Code([])
        if self._network.inputs:
            start = 0
            with body.inside("k < last") as inner:
                for name, size in self._network.inputs.items():
                    inner.copy(size, "row(recorded, k)", self._port(Port(None, name)), first=start)
                    start += size
        self._write_logs(body, "k")
        body.add("if k == last:")
        body.add("    break")
        for phase in (Phase.SENSE, Phase.COMPUTE):
            self._write_phase(body, phase)
        self._write_step(body)
        logs = "".join(f", {self._log_name(name)}" for name in self._log)
        head = [
            f"def rollout(first, last, x, d, p, recorded{logs}):",
            '    """Ticks first to last; x, d: continuous and discrete state, changed in place; p: parameters;',
            "    recorded (ticks, inputs): what drives the exported inputs. Returns the tick that was reached.\"\"\"",
            *self._vectors(),
            "    reached = last",
            "    for k in range(first, last + 1):",
        ]
        return "\n".join([*head, *body.lines, *self._store(), "    return reached", ""])

    def _vectors(self) -> list[str]:
        """State, parameters and ports as vectors of constant size (views.py), made once before the loop."""
        code = _Code([], depth=1)
        for name, leaf in self._network.leaves.items():
            if leaf.spec.derivatives is not None:
                size = len(leaf.continuous_state)
                for vector in ("x", "x0", "k1", "k2", "dx"):
                    code.add(_made(self._vector(name, vector), size))
                code.copy(size, "x", self._vector(name, "x"), first=self.layout.continuous[name].start)
            if size := len(leaf.discrete_state):
                before = [] if self._is_in_place(name) else ["next"]
                for vector in ("d", *before, *(["held"] if self._has_several(name) else [])):
                    code.add(_made(self._vector(name, vector), size))
                code.copy(size, "d", self._vector(name, "d"), first=self.layout.discrete[name].start)
            start = self.layout.parameters[name].start
            for parameter, size, is_scalar in parameter_sizes(leaf.spec):
                own = self._parameter(name, parameter)
                if is_scalar:
                    code.add(f"{own} = p[{start}]")
                elif size > _LONGEST_COPY:
                    code.add(f"{own} = part(p, {start}, {size})")
                else:
                    code.add(_made(own, size))
                    code.copy(size, "p", own, first=start)
                start += size
        for port in [key for key in self._names if isinstance(key, Port)]:
            code.add(_made(self._port(port), self._network.source_size(port)))
        code.add("empty = local(0)")
        return code.lines

    def _store(self) -> list[str]:
        """Put the state back into the packed vectors."""
        code = _Code([], depth=1)
        for name, leaf in self._network.leaves.items():
            if size := len(leaf.continuous_state):
                code.copy(size, self._vector(name, "x"), "x", at=self.layout.continuous[name].start)
            if size := len(leaf.discrete_state):
                code.copy(size, self._vector(name, "d"), "d", at=self.layout.discrete[name].start)
        return code.lines

    # -- phases ----------------------------------------------------------------------------------------------------

    def _write_logs(self, code: _Code, tick: str) -> None:
        for divisor in sorted({divisor for _, divisor in self._log.values()}, key=lambda d: d or 0):
            due = "k == last" if divisor is None else None if divisor == 1 else f"k % {divisor} == 0"
            with code.inside(due) as inner:
                for name, (port, its) in self._log.items():
                    if its == divisor:
                        self._evaluate(inner, port, tick)
                        row = "0" if divisor is None else "k" if divisor == 1 else f"k // {divisor}"
                        size = self._network.source_size(port)
                        inner.copy(size, self._port(port), f"row({self._log_name(name)}, {row})")

    def _write_phase(self, code: _Code, phase: Phase) -> None:
        """All updates of a phase see the state before it; then all are stored. Those of one leaf act one after the
        other, in the order declared."""
        alone: dict[str | None, list[tuple[str, Update]]] = {}
        ordered = []
        for name, leaf in self._network.leaves.items():
            updates = [update for update in leaf.spec.updates if update.phase is phase]
            for condition, group in itertools.groupby(updates, _condition):
                due = [(name, update) for update in group]
                if self._has_several(name):
                    ordered.append((condition, due))
                else:
                    alone.setdefault(condition, []).extend(due)
        groups = sorted(alone.items(), key=lambda item: item[0] or "") + ordered
        if not groups:
            return
        code.add(f"# {phase.value}")
        for name in sorted({name for _, group in ordered for name, _ in group}):
            self._copy_memory(code, name, "d", "next")
        late: list[tuple] = []
        for condition, group in groups:
            with code.inside(condition) as inner:
                for name, update in group:
                    if self._is_in_place(name):
                        late.append((name, update, self._arguments(inner, name, update.kernel, "k")))
                    else:
                        self._write_update(inner, name, update)
        for name, update, values in late:  # nothing reads the memory of before any more
            self._call(code, update.kernel, values, self._vector(name, "d"))
        for condition, group in groups:
            with code.inside(condition) as inner:
                for name in dict.fromkeys(name for name, _ in group if not self._is_in_place(name)):
                    self._copy_memory(inner, name, "next", "d")
        changed = {("d", name) for _, group in groups for name, _ in group}
        code.fresh = {item for item in code.fresh if not changed & self._depends(item)}

    def _copy_memory(self, code, name, source, target):
        size = len(self._network.leaves[name].discrete_state)
        code.copy(size, self._vector(name, source), self._vector(name, target))

    def _has_several(self, name):
        return len(self._network.leaves[name].spec.updates) > 1

    def _is_in_place(self, name):
        """Whether the only update of a leaf is due at every tick and may write into the memory itself."""
        (update, *others) = self._network.leaves[name].spec.updates or [None]
        if update is None or others or update.through:
            return False
        return update.in_place and _condition(update) is None

    def _write_update(self, code: _Code, name: str, update: Update) -> None:
        if update.through:
            self._step(code, name, "k")
            return
        values = self._arguments(code, name, update.kernel, "k")
        if self._has_several(name):  # one after the other, in the order declared
            self._copy_memory(code, name, "next", "held")
            values = [self._vector(name, "held") if value == self._vector(name, "d") else value for value in values]
        self._call(code, update.kernel, values, self._vector(name, "next"))

    def _write_step(self, code: _Code) -> None:
        """Drake's fixed-step Runge-Kutta 3, in its own order of operations."""
        leaves = [name for name, leaf in self._network.leaves.items() if leaf.spec.derivatives is not None]
        if not leaves:
            return
        code.add("# integrate over [t_k, t_k+1)")
        code.add(f"h = (k + 1) * {TICK_S!r} - k * {TICK_S!r}")
        steady = _Code(code.lines, set(code.fresh), code.depth)
        for name in leaves:  # what does not change during the step is evaluated once
            for port in self._sources(name, self._network.leaves[name].spec.derivatives):
                self._evaluate_steady(steady, port)
        stages = (
            ("k", []),
            ("k", ["{k1}[i] = {dx}[i]", "{x0}[i] = {x}[i]", "{x}[i] = {x0}[i] + (0.5 * h) * {k1}[i]"]),
            ("k + 1", ["{k2}[i] = {dx}[i]", "{x}[i] = {x0}[i] + (-h * {k1}[i] + (2.0 * h) * {k2}[i])"]),
        )
        for tick, lines in stages:
            self._for_each_state(code, lines)
            moved = lambda item: any(atom[0] in ("x", "tick") for atom in self._depends(item))  # noqa: E731
            inner = _Code(code.lines, {item for item in steady.fresh if not moved(item)}, code.depth)
            for name in leaves:
                function = self._network.leaves[name].spec.derivatives
                values = self._arguments(inner, name, function, tick)
                self._call(code, function, values, self._vector(name, "dx"))
        code.add("h6 = h / 6.0")
        self._for_each_state(code, ["{x}[i] = {x0}[i] + ((h6 * {k1}[i] + (4.0 * h6) * {k2}[i]) + h6 * {dx}[i])"])
        code.add(f"if k % {_CHECK_TICKS} == 0:")
        inner = _Code(code.lines, depth=code.depth + 1)
        inner.add("finite = True")
        self._for_each_state(inner, ["finite = finite and np.isfinite({x}[i])"])
        inner.add("if not finite:")
        inner.add("    reached = k")
        inner.add("    break")

    def _for_each_state(self, code: _Code, lines: list[str]) -> None:
        """The lines for every element `i` of every leaf with a continuous state, `{x}` and so on its vectors."""
        for name, leaf in self._network.leaves.items():
            if lines and leaf.spec.derivatives is not None:
                vectors = {vector: self._vector(name, vector) for vector in ("x", "x0", "k1", "k2", "dx")}
                code.add(f"for i in range({len(leaf.continuous_state)}):")
                for line in lines:
                    code.add("    " + line.format(**vectors))

    # -- evaluating outputs ----------------------------------------------------------------------------------------

    def _evaluate(self, code: _Code, port: Port, tick: str) -> None:
        if port in code.fresh or port.leaf is None:
            self._port(port)
            return
        leaf = self._network.leaves[port.leaf]
        function = leaf.spec.outputs[port.name].kernel
        stepped = _through(leaf.spec) is not None and "xd" in arguments(function)
        if stepped:
            self._step(code, port.leaf, tick)
        values = self._arguments(code, port.leaf, function, tick, stepped)
        self._call(code, function, values, self._port(port))
        code.fresh.add(port)

    def _evaluate_steady(self, code: _Code, port: Port) -> None:
        """Evaluate `port`, or what feeds it, as far as it does not depend on the continuous state or the tick."""
        if port.leaf is None or port in code.fresh:
            return
        if not any(atom[0] in ("x", "tick") for atom in self._depends(port)):
            self._evaluate(code, port, "k")
            return
        leaf = self._network.leaves[port.leaf]
        for name in arguments(leaf.spec.outputs[port.name].kernel):
            if name in leaf.sources:
                self._evaluate_steady(code, leaf.sources[name])

    def _step(self, code: _Code, name: str, tick: str) -> None:
        """Evaluate the state of a direct feed-through block after its newest samples."""
        if ("step", name) in code.fresh:
            return
        function = _through(self._network.leaves[name].spec).kernel
        values = self._arguments(code, name, function, tick)
        self._call(code, function, values, self._vector(name, "next"))
        code.fresh.add(("step", name))

    def _arguments(self, code: _Code, name: str, function, tick: str, stepped: bool = False) -> list[str]:
        leaf, values = self._network.leaves[name], []
        for argument in arguments(function):
            if argument in leaf.spec.inputs:
                self._evaluate(code, leaf.sources[argument], tick)
                values.append(self._port(leaf.sources[argument]))
            elif argument == "xd":
                held = "next" if stepped else "d"
                values.append(self._vector(name, held) if len(leaf.discrete_state) else "empty")
            elif argument == "xc":
                values.append(self._vector(name, "x"))
            else:
                values.append(tick if argument == "tick" else self._parameter(name, argument))
        return values

    def _sources(self, name, function):
        leaf = self._network.leaves[name]
        return [leaf.sources[argument] for argument in arguments(function) if argument in leaf.sources]

    def _depends(self, item) -> frozenset:
        """The atoms ("x", leaf), ("d", leaf), ("tick",) that a port, or a leaf's step, depends on."""
        if item in self._dependencies:
            return self._dependencies[item]
        if isinstance(item, Port) and item.leaf is None:
            return frozenset()
        name = item.leaf if isinstance(item, Port) else item[1]
        leaf = self._network.leaves[name]
        through = _through(leaf.spec)
        function = leaf.spec.outputs[item.name].kernel if isinstance(item, Port) else through.kernel
        atoms: set = set()
        for argument in arguments(function):
            if argument in leaf.sources:
                atoms |= self._depends(leaf.sources[argument])
            elif argument == "xd":
                atoms.add(("d", name))
                if through is not None and isinstance(item, Port):
                    atoms |= self._depends(("step", name))
            elif argument == "xc":
                atoms.add(("x", name))
            elif argument == "tick":
                atoms.add(("tick",))
        self._dependencies[item] = frozenset(atoms)
        return self._dependencies[item]

    # -- names -----------------------------------------------------------------------------------------------------

    def _name(self, key: object, wanted: str) -> str:
        """The name in the text for `key`, as near to `wanted` as may be; all names come from here, no two are equal."""
        if key not in self._names:
            wanted = re.sub(r"[^0-9A-Za-z_]", "_", wanted)
            if not _is_log(key) and re.match(r"\d|_|lanes_|log_", wanted):
                wanted = f"n{wanted}"
            candidates = itertools.chain([wanted], (f"{wanted}_{i}" for i in itertools.count(2)))
            self._names[key] = next(name for name in candidates if name not in self._taken)
            self._taken.add(self._names[key])
        return self._names[key]

    def _vector(self, leaf: str, vector: str) -> str:
        return self._name(("vector", leaf, vector), f"{leaf}_{vector}")

    def _parameter(self, leaf: str, parameter: str) -> str:
        return self._name(("p", leaf, parameter), f"{leaf}_{parameter}")

    def _port(self, port: Port) -> str:
        return self._name(port, f"{'input' if port.leaf is None else port.leaf}__{port.name}")

    def _log_name(self, log: str) -> str:
        return self._name(("log", log), f"log_{log}")

    def _call(self, code: _Code, function, values: list[str], out: str) -> None:
        """A call of a kernel; its name in the text is that of its module and its own."""
        module = getattr(function, "py_func", function).__module__.rpartition(".")[2]
        name = self._name(("kernel", function), f"{module}_{function.__name__}")
        self.kernels[name] = function
        code.add(f"{name}({', '.join([*values, out])})")


def _is_log(key) -> bool:
    return isinstance(key, tuple) and key[0] == "log"


def _made(name: str, size: int) -> str:
    return f"{name} = {'local' if size <= _LARGEST_LOCAL else 'np.zeros'}({size})"


def _through(spec) -> Update | None:
    return next((update for update in spec.updates if update.through), None)


def _condition(update: Update) -> str | None:
    """When an update is due, None for every tick."""
    if update.period_ticks == 1 and update.offset_ticks == 0:
        return None
    if update.offset_ticks == 0:
        return f"k % {update.period_ticks} == 0"
    return f"k >= {update.offset_ticks} and (k - {update.offset_ticks}) % {update.period_ticks} == 0"
