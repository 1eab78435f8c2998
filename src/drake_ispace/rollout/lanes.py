"""Many runs of one Diagram at once, one to a SIMD lane: states, ports and parameters are laid out [element][lane].

What the emitted rollout does between two decisions about the tick becomes a loop over the lanes, of which each loads
the numbers of its lane into small vectors, calls the kernels unchanged, and puts back what they wrote. LLVM turns such
a loop into vector instructions unless a kernel in it has a loop that depends on data or calls the system's library
(functions.py takes the place of its sin, exp and so on); then it is run lane by lane. The operations of a lane are
those of a single run, so are its results, to the last bit.
"""

import ast
import copy
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numba
import numpy as np
from pydrake.systems.framework import Diagram

from drake_ispace.blocks.errors import InputError
from drake_ispace.rollout import views
from drake_ispace.rollout.compile import Rollout, check_ticks, compile_diagram, machine_code, rows_in

LANES = 32
_LARGEST = 4096  # floats of a matrix on the stack; a larger one, a long queue, lies on the heap


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
            name -> (runs, ticks // divisor + 1, size), run by run what `single.run` gives.

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
            return self.single.opened(ticks, inputs)[1][:, :, None]
        by_run = ({n: s[run] if n in each else s for n, s in inputs.items()} for run in range(runs))
        return np.stack([self.single.opened(ticks, one)[1] for one in by_run], axis=2)


def compile_lanes(
    diagram: Diagram, log: Mapping[str, int] | None = None, lanes: int = LANES, varied: Iterable[str] | None = None,
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
    text = _Writer(ast.parse(single.source).body[0], lanes, single.parameters, may_vary).text
    functions = {"local": views.local, "matrix": views.matrix, "part": views.part, **single.kernels}
    rows, cube = numba.float64[:, ::1], numba.float64[:, :, ::1]
    arguments = (numba.int64, numba.int64, rows, rows, rows, rows, cube, numba.int64[::1])
    function = machine_code(text, functions, (*arguments, *[cube] * len(single.logged)), single.digest)
    return LaneRollout(single, text, lanes, may_vary, function)


def _of_each(name, values, default, runs):
    """(runs, n) states."""
    states = np.asarray(default if values is None else values, dtype=float)
    if states.shape not in (default.shape, (runs, *default.shape)):
        raise InputError(f"{name}: is an array {states.shape}, expected {default.shape} or {(runs, *default.shape)}")
    return np.broadcast_to(states, (runs, *default.shape))


class _Writer:
    """The text of an emitted rollout, rewritten for lanes.

    A vector `v` is that of the lane at hand; `lanes_v` holds it for all lanes.
    """

    def __init__(self, rollout: ast.FunctionDef, lanes: int, parameters: np.ndarray, varied: np.ndarray):
        self._lanes, self._parameters, self._varied = lanes, parameters, varied
        self._sizes: dict[str, int] = {}  # of vectors
        self._views: dict[str, str] = {}  # parameters that are one float, or a table -> where they lie
        body = rollout.body[1:]
        ticks = next(i for i, s in enumerate(body) if isinstance(s, ast.For) and ast.unparse(s.target) == "k")
        head, loop, tail = body[:ticks], body[ticks].body, body[ticks + 1 :]
        filled = [statement for statement in head if isinstance(statement, ast.For)]
        self._constants = {name: values for name, values in map(self._filled, filled) if values is not None}
        for statement in head:
            if isinstance(statement, ast.Assign):
                self._declare(statement)
        self._begun = [loop for loop in filled if {"x", "d"} & _names(loop)]
        vectors = {self._filled(loop)[0] for loop in filled if "p" in _names(loop)} - set(self._constants)
        floats = {name for name, view in self._views.items() if "[" in view}
        self._varying = {name for name in vectors | floats if not name.endswith("_noise_stream")}
        self._own = self._of_one_group(loop, filled)
        start = [line for loop in filled if not set(self._constants) & _names(loop) for line in self._copy(loop)]
        store = [line for statement in tail if isinstance(statement, ast.For) for line in self._copy(statement)]
        inner = self._block(loop)
        logs = "".join(f", {a.arg}" for a in rollout.args.args if a.arg.startswith("log_"))
        vectors = [line for v, size in self._sizes.items() for line in self._made(v, size)]
        for name, values in self._constants.items():
            vectors += [f"{name} = local({len(values)})", *(f"{name}[{i}] = {_text(v)}" for i, v in enumerate(values))]
        lines = [
            f"def rollout(first, last, x, d, p, rows, recorded, reached{logs}):",
            '    """One more index on every array, the lane; rows: the parameters lane by lane."""',
            *_indented([*vectors, "empty = local(0)", *start, "for k in range(first, last + 1):", *_indented(inner)]),
            *_indented(store),
        ]
        self.text = "\n".join([*lines, ""])

    def _made(self, vector, size):
        if vector in self._own:
            return [f"{vector} = local({size})"]
        if size * self._lanes <= _LARGEST:
            return [f"{vector} = local({size})", f"lanes_{vector} = matrix({size}, {self._lanes})"]
        return [f"{vector} = np.zeros({size})", f"lanes_{vector} = np.zeros(({size}, {self._lanes}))"]

    def _filled(self, loop: ast.For) -> tuple[str, np.ndarray | None]:
        """The vector that a loop fills, and its values if they are parameters that do not vary."""
        (assignment,) = loop.body
        name, source = assignment.targets[0].value.id, assignment.value
        if source.value.id != "p":
            return name, None
        start = source.slice.left.value if isinstance(source.slice, ast.BinOp) else 0
        part = slice(start, start + loop.iter.args[0].value)
        return name, None if self._varied[part].any() else self._parameters[part]

    def _declare(self, statement):
        name, value = statement.targets[0].id, statement.value
        if isinstance(value, ast.Subscript):  # p[7]
            place = value.slice.value
            self._views[name] = f"p[{place}, lane]" if self._varied[place] else _text(self._parameters[place])
        elif isinstance(value, ast.Call) and ast.unparse(value.func) == "part":  # part(p, start, size)
            self._views[name] = f"part(rows[lane], {', '.join(map(ast.unparse, value.args[1:]))})"
        elif isinstance(value, ast.Call) and name != "empty" and name not in self._constants:  # local(size)
            self._sizes[name] = value.args[0].value

    def _of_one_group(self, loop, filled) -> set[str]:
        """Vectors that are written and read within one group only: no lane has to remember them."""
        states = {name for statement in filled for name in _names(statement)}
        seen, own = Counter(), set()
        for group in self._groups(loop):
            written: set[str] = set()
            for statement in group:
                for name in _names(statement) - written - set(_written(statement)):
                    own.discard(name)  # read before it is written here
                    seen[name] += 1
                written |= set(_written(statement))
            for name in written:
                seen[name] += 1
                own.add(name)
        return {name for name in own if seen[name] == 1 and name in self._sizes and name not in states}

    def _groups(self, statements) -> list[list[ast.stmt]]:
        """The kernels and copies of each loop over the lanes, those within decisions too."""
        groups: list[list[ast.stmt]] = [[]]
        for statement in statements:
            if isinstance(statement, ast.If):
                groups += [*([] if "finite" in _names(statement) else self._groups(statement.body)), []]
            elif isinstance(statement, ast.Expr) and self._stands_alone(statement):
                groups += [[statement], []]
            elif isinstance(statement, ast.Expr | ast.For):
                groups[-1].append(statement)
        return groups

    def _block(self, statements: Sequence[ast.stmt]) -> list[str]:
        """Statements, those between two decisions in one loop over the lanes."""
        lines, group = [], []
        for statement in statements:
            if isinstance(statement, ast.Assign):  # the length of a step
                lines.append(ast.unparse(statement))
            elif isinstance(statement, ast.If):
                lines += self._group(group) + self._decision(statement)
                group = []
            elif self._stands_alone(statement):
                lines += self._group(group) + self._group([statement])
                group = []
            else:
                group.append(statement)
        return lines + self._group(group)

    def _stands_alone(self, statement) -> bool:
        """Whether a kernel reads parameters that vary: it is long, and LLVM gives up on loops that are too long."""
        return isinstance(statement, ast.Expr) and not self._varying.isdisjoint(_names(statement))

    def _decision(self, statement: ast.If) -> list[str]:
        if "finite" in _names(statement):
            return self._watch(statement)
        inner = ["break"] if isinstance(statement.body[0], ast.Break) else self._block(statement.body)
        return [f"if {ast.unparse(statement.test)}:", *_indented(inner)]

    def _group(self, group: Sequence[ast.stmt]) -> list[str]:
        """Kernels and copies for one lane after the other, on vectors that are loaded before and stored after them."""
        if not group:
            return []
        used = list(dict.fromkeys(name for statement in group for name in _names_in_order(statement)))
        lines = [f"{name} = {self._views[name]}" for name in used if name in self._views]
        kept = [name for name in used if name in self._sizes and name not in self._own]
        for name in kept:
            lines += [f"for i in range({self._sizes[name]}):", f"    {name}[i] = lanes_{name}[i, lane]"]
        for statement in group:
            lines += self._elements(statement, {}) if isinstance(statement, ast.For) else [ast.unparse(statement)]
        for name in dict.fromkeys(name for statement in group for name in _written(statement)):
            if name in kept:
                lines += [f"for i in range({self._sizes[name]}):", f"    lanes_{name}[i, lane] = {name}[i]"]
        return self._looped(lines)

    def _copy(self, loop: ast.For) -> list[str]:
        """An element-wise copy between what is laid out in lanes."""
        return self._looped(self._elements(loop, self._sizes))

    def _elements(self, loop: ast.For, laid_out: Mapping[str, int]) -> list[str]:
        """An element-wise copy of one lane; laid_out: vectors that are taken from all lanes."""
        body = [ast.unparse(_Laned(laid_out).visit(copy.deepcopy(inner))) for inner in loop.body]
        return [f"for i in {ast.unparse(loop.iter)}:", *_indented(body)]

    def _watch(self, statement: ast.If) -> list[str]:
        """Note the tick at which a single run would stop; the lane begins anew, so that no index is made of a NaN."""
        looks = [inner for inner in statement.body if isinstance(inner, ast.For)]
        again = [line for loop in self._begun for line in self._elements(loop, self._sizes)]
        lines = [
            "finite = True", *(line for loop in looks for line in self._elements(loop, self._sizes)),
            "if not finite:", *_indented(["reached[lane] = min(reached[lane], k)", *again]),
        ]
        return [f"if {ast.unparse(statement.test)}:", *_indented(self._looped(lines))]

    def _looped(self, lines: Sequence[str]) -> list[str]:
        return [f"for lane in range({self._lanes}):", *_indented(lines)]


class _Laned(ast.NodeTransformer):
    """Appends the lane to the index of the arrays that hold all lanes: those of the caller, and `vectors`."""

    def __init__(self, vectors: Mapping[str, int]):
        self._vectors = vectors

    def visit_Subscript(self, node):
        name = node.value.id
        if name in self._vectors:
            node.value.id = f"lanes_{name}"
        elif name not in ("x", "d", "p", "recorded") and not name.startswith("log_"):
            return node
        inner = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        node.slice = ast.Tuple([*inner, ast.Name("lane", ast.Load())], ast.Load())
        return node


def _names(node) -> set[str]:
    return set(_names_in_order(node))


def _names_in_order(statement) -> list[str]:
    return [inner.id for inner in ast.walk(statement) if isinstance(inner, ast.Name)]


def _written(statement) -> list[str]:
    """The vectors that a statement writes: targets, and the last argument of a kernel."""
    if isinstance(statement, ast.Expr):
        return [statement.value.args[-1].id]
    return [target.value.id for inner in statement.body for target in inner.targets]


def _text(value) -> str:
    return repr(float(value)).replace("inf", "np.inf")


def _indented(lines: Sequence[str]) -> list[str]:
    return [f"    {line}" for text in lines for line in text.split("\n")]
