"""Many runs of one Diagram at once, one to a SIMD lane: states, ports and parameters are laid out [element][lane].

The emitted rollout gets loops over the lanes: each loads the numbers of its lane into small vectors, runs the emitted
lines unchanged, and puts back what they wrote. LLVM turns such a loop into vector instructions. The operations of a
lane are those of a single run, so are its results, to the last bit. It pays for kernels without branches that depend on
data and without sin, exp or log, which have no vector form that agrees with the scalar one: plain arithmetic, not the
robots' plants.
"""

import ast
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numba
import numpy as np
from numba.core.dispatcher import Dispatcher
from pydrake.systems.framework import Diagram

from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.kernels import text_of
from drake_ispace.rollout import views
from drake_ispace.rollout.compile import Rollout, check_ticks, compile_diagram

_NUMPY_FUNCTIONS = {"floor", "sqrt"}
_PYTHON_FUNCTIONS = {"abs", "min", "max", "range"}


@dataclass(frozen=True)
class LaneRollout:
    """A Diagram compiled for `lanes` runs at once; made by `compile_lanes`.

    Attributes:
        single: the same Diagram, run by run: names and values of the parameters, what is logged.
        source: the text of the compiled function; lanes: runs at once.
    """

    single: Rollout
    source: str
    lanes: int
    _function: object = field(repr=False)

    def run(self, ticks: int, parameters: np.ndarray) -> dict[str, np.ndarray]:
        """Roll out once for every row of `parameters` (runs, len(parameter_names)), from the Context's state.

        Returns:
            name -> (runs, ticks // divisor + 1, size), run by run what `single.run` gives. A run that leaves the
            numbers goes on with infinities and NaN in its lane instead of stopping.

        Raises:
            InputError: a number of ticks that no clock holds, or rows of another length.
        """
        check_ticks(ticks)
        parameters = np.atleast_2d(np.asarray(parameters, dtype=float))
        runs, size = len(parameters), len(self.single.parameters)
        if parameters.shape != (runs, size):
            raise InputError(f"parameters: are an array {parameters.shape}, expected (runs, {size})")
        logs = {
            name: np.empty((runs, ticks // divisor + 1, size)) for name, (size, divisor) in self.single.logged.items()
        }
        for start in range(0, runs, self.lanes):
            chosen = np.minimum(np.arange(start, start + self.lanes), runs - 1)  # the last group repeats its last run
            rows = [np.empty((*log.shape[1:], self.lanes)) for log in logs.values()]
            p = np.array(parameters[chosen].T, order="C")
            states = (self.single.continuous_state, self.single.discrete_state)
            self._function(0, ticks, *(np.repeat(s[:, None], self.lanes, axis=1) for s in states), p, *rows)
            for log, lanes in zip(logs.values(), rows, strict=True):
                part = log[start : start + self.lanes]
                part[:] = np.moveaxis(lanes, -1, 0)[: len(part)]
        return logs


def compile_lanes(diagram: Diagram, log: Mapping[str, int] | None = None, lanes: int = 32) -> LaneRollout:
    """Compile `diagram` for `lanes` runs at once; log: as of `compile_diagram`.

    Raises:
        InputError: exported inputs, or a kernel that gains nothing from lanes, named with the reason.
    """
    single = compile_diagram(diagram, log=log)
    if single.inputs:
        raise InputError("lanes: exported inputs are not laid out in lanes, expected a Diagram without inputs")
    for name, kernel in single.kernels.items():
        if reason := _obstacle(kernel):
            raise InputError(f"lanes: kernel {name} {reason}, expected arithmetic without branches on data")
    text = _Writer(ast.parse(single.source).body[0], lanes).text
    names = {"np": np, "local": views.local, "matrix": views.matrix, **single.kernels}
    exec(compile(text, "<lanes>", "exec"), names)
    function = numba.njit(nogil=True, error_model="numpy")(names["rollout"])
    rows, cube = numba.float64[:, ::1], numba.float64[:, :, ::1]
    function.compile((numba.int64, numba.int64, rows, rows, rows, *[cube] * len(single.logged)))
    function.disable_compile()
    return LaneRollout(single, text, lanes, function)


class _Writer:
    """The text of an emitted rollout, rewritten for lanes.

    A vector `v` is that of the lane at hand; `lanes_v` holds it for all lanes. One that lives only inside a single loop
    over the lanes has no `lanes_v`.
    """

    def __init__(self, rollout: ast.FunctionDef, lanes: int):
        self._lanes = lanes
        body = rollout.body[1:]
        ticks = next(i for i, s in enumerate(body) if isinstance(s, ast.For) and ast.unparse(s.target) == "k")
        head, loop, tail = body[:ticks], body[ticks].body, body[ticks + 1 :]
        self._sizes: dict[str, int] = {}  # of vectors
        self._scalars: dict[str, int] = {}  # parameters that are one float -> where in p
        filled = [s for s in head if isinstance(s, ast.For)]
        for statement in head:
            if isinstance(statement, ast.Assign):
                self._declare(statement, filled)
        groups = _groups(loop)
        self._shared = {v for v in self._sizes if any(v in _names(s) for s in filled) or _crosses(v, groups)}
        arguments = ", ".join(a.arg for a in rollout.args.args if a.arg != "recorded")
        lines = [f"def rollout({arguments}):", '    """One more index on every array: the lane."""']
        lines += [f"    {v} = local({size})" for v, size in self._sizes.items()]
        lines += [f"    lanes_{v} = matrix({size}, {lanes})" for v, size in self._sizes.items() if v in self._shared]
        lines += self._loop(filled, "    ")
        lines += ["    for k in range(first, last + 1):"]
        for condition, statements in groups:
            if condition == "k == last":
                lines += ["        if k == last:", "            break"]
            elif statements:
                lines += [f"        if {condition}:"] if condition else []
                lines += self._loop(statements, "            " if condition else "        ")
        lines += self._loop([s for s in tail if isinstance(s, ast.For)], "    ")
        self.text = "\n".join([*lines, "    return last", ""])

    def _declare(self, statement, filled):
        name, value = statement.targets[0].id, statement.value
        if isinstance(value, ast.Call) and ast.unparse(value.func) == "np.zeros":
            raise InputError(f"lanes: {name} has {value.args[0].value} floats, expected vectors that fit on the stack")
        if isinstance(value, ast.Call) and value.func.id == "local":
            self._sizes[name] = value.args[0].value
        elif isinstance(value, ast.Call):  # part(p, start, size)
            start, self._sizes[name] = (argument.value for argument in value.args[1:])
            filled += ast.parse(f"for i in range({self._sizes[name]}):\n    {name}[i] = p[{start} + i]").body
        elif isinstance(value, ast.Subscript):
            self._scalars[name] = value.slice.value

    def _loop(self, statements: Sequence[ast.stmt], indent: str) -> list[str]:
        """The statements for one lane after the other, with what they read and write loaded and stored."""
        used, written = set().union(*map(_names, statements)), set().union(*map(_written, statements))
        inner = [f"{name} = p[{place}, lane]" for name, place in self._scalars.items() if name in used]
        for vector, size in self._sizes.items():
            if vector in self._shared & used:
                inner += [f"for i in range({size}):", f"    {vector}[i] = lanes_{vector}[i, lane]"]
        for statement in statements:
            inner += ast.unparse(ast.fix_missing_locations(_PackedIndex().visit(statement))).splitlines()
        for vector, size in self._sizes.items():
            if vector in self._shared & written:
                inner += [f"for i in range({size}):", f"    lanes_{vector}[i, lane] = {vector}[i]"]
        return [f"{indent}for lane in range({self._lanes}):", *(f"{indent}    {line}" for line in inner)]


class _PackedIndex(ast.NodeTransformer):
    """Appends the lane to the index of the arrays that the caller passes."""

    def visit_Subscript(self, node):
        if isinstance(node.value, ast.Name) and (node.value.id in ("x", "d", "p") or node.value.id.startswith("log_")):
            inner = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
            node.slice = ast.Tuple([*inner, ast.Name("lane", ast.Load())], ast.Load())
        return node


def _groups(loop: Sequence[ast.stmt]) -> list[tuple[str | None, list[ast.stmt]]]:
    """The body of the loop over the ticks as (condition, statements): LLVM vectorises only loops without branches."""
    groups: list[tuple[str | None, list[ast.stmt]]] = [(None, [])]
    for statement in loop:
        if not isinstance(statement, ast.If):
            groups[-1][1].append(statement)
        elif "reached" not in _names(statement):  # lanes do not stop early
            groups += [(ast.unparse(statement.test), statement.body), (None, [])]
    return groups


def _crosses(vector, groups) -> bool:
    """Whether a vector carries something from one group, or tick, to another."""
    return sum(any(vector in _names(s) for s in statements) for _, statements in groups) > 1


def _names(node) -> set[str]:
    return {inner.id for inner in ast.walk(node) if isinstance(inner, ast.Name)}


def _written(node) -> set[str]:
    """The vectors that a statement writes: targets, and the last argument of a kernel."""
    if isinstance(node, ast.For):
        return set().union(*map(_written, node.body))
    if isinstance(node, ast.Expr):
        return _names(node.value.args[-1])
    return {target.value.id for target in node.targets if isinstance(target, ast.Subscript)}


def _obstacle(kernel: Dispatcher) -> str | None:
    """Why a kernel, or a helper of it, gains nothing from lanes."""
    function = kernel.py_func
    text = text_of(kernel)
    if text is None:
        return "has no source text"
    (definition,) = ast.parse(textwrap.dedent(text)).body
    for node in definition.body:
        for inner in ast.walk(node):
            if isinstance(inner, ast.If | ast.While):
                return f"branches in line {inner.lineno} of {function.__name__}"
            if not isinstance(inner, ast.Call):
                continue
            if isinstance(inner.func, ast.Attribute) and inner.func.attr not in _NUMPY_FUNCTIONS:
                return f"calls {ast.unparse(inner.func)}"
            helper = function.__globals__.get(getattr(inner.func, "id", None))
            if isinstance(helper, Dispatcher):
                if reason := _obstacle(helper):
                    return reason
            elif isinstance(inner.func, ast.Name) and inner.func.id not in _PYTHON_FUNCTIONS:
                return f"calls {inner.func.id}"
    return None
