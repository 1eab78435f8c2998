"""The text of a rollout for many lanes, from the text of the same rollout for a single run."""

import ast
import copy
from collections import Counter
from collections.abc import Collection, Mapping, Sequence

import numpy as np

_LARGEST = 4096  # floats of a matrix on the stack; a larger one, a long queue, lies on the heap


def text_for_lanes(
    source: str, lanes: int, parameters: np.ndarray, varied: np.ndarray, long_kernels: Collection[str]
) -> str:
    """Return the text of the function for `lanes` runs.

    source: of the function for a single run. parameters: its values; varied: which of them may differ between runs.
    long_kernels: names of those that do more than copy.
    """
    rollout = ast.fix_missing_locations(_Loops().visit(ast.parse(source).body[0]))
    return _Writer(rollout, lanes, parameters, varied, long_kernels).text


class _Writer:
    """The text of an emitted rollout, rewritten for lanes.

    A vector `v` is that of the lane at hand; `lanes_v` holds it for all lanes.
    """

    def __init__(self, rollout: ast.FunctionDef, lanes, parameters, varied, long_kernels):
        self._lanes, self._parameters, self._varied, self._long = lanes, parameters, varied, long_kernels
        self._sizes: dict[str, int] = {}  # of vectors
        self._views: dict[str, str] = {}  # parameters that are one float, or a table -> where they lie
        body = rollout.body[1:]
        ticks = next(i for i, s in enumerate(body) if isinstance(s, ast.For) and ast.unparse(s.target) == "k")
        head, loop, tail = body[:ticks], body[ticks].body, body[ticks + 1 :]
        filled = [statement for statement in head if isinstance(statement, ast.For)]
        parameters_of = dict(self._filled(loop) for loop in filled if "p" in _names(loop))
        self._constants = {name: values for name, values in parameters_of.items() if values is not None}
        for statement in head:
            if isinstance(statement, ast.Assign):
                self._declare(statement)
        self._begun = [loop for loop in filled if {"x", "d"} & _names(loop)]
        floats = {name for name, view in self._views.items() if "[" in view}
        varying = parameters_of.keys() - self._constants.keys() | floats
        self._varying = {name for name in varying if not name.endswith("_noise_stream")}
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
        """The vector that a loop fills with parameters, and their values if they do not vary."""
        (assignment,) = loop.body
        name, source = assignment.targets[0].value.id, assignment.value
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
        seen, made = Counter(), set()
        for group in self._groups(loop):
            written: set[str] = set()
            for statement in group:
                seen.update(_names(statement) - written - set(_written(statement)))  # read before it is written here
                written |= set(_written(statement))
            seen.update(written)
            made |= written
        return {name for name in made if seen[name] == 1 and name in self._sizes and name not in states}

    def _parts(self, statements: Sequence[ast.stmt]) -> list[list[ast.stmt] | ast.stmt]:
        """Decisions about the tick, the length of a step, and between them groups: each one loop over the lanes."""
        parts: list[list[ast.stmt] | ast.stmt] = [[]]
        for statement in statements:
            if isinstance(statement, ast.If):
                parts += [statement, []]
            elif isinstance(statement, ast.Assign):
                parts.insert(-1, statement)
            elif self._stands_alone(statement):
                parts += [[statement], []]
            else:
                parts[-1].append(statement)
        return parts

    def _groups(self, statements: Sequence[ast.stmt]) -> list[list[ast.stmt]]:
        """All groups, those within decisions too."""
        groups = []
        for part in self._parts(statements):
            if isinstance(part, list):
                groups.append(part)
            elif isinstance(part, ast.If) and not _ends(part) and not _looks(part):
                groups += self._groups(part.body)
        return groups

    def _block(self, statements: Sequence[ast.stmt]) -> list[str]:
        """The lines of statements at one level."""
        lines = []
        for part in self._parts(statements):
            if isinstance(part, list):
                lines += self._group(part)
            else:
                lines += self._decision(part) if isinstance(part, ast.If) else [ast.unparse(part)]
        return lines

    def _stands_alone(self, statement) -> bool:
        """Whether it is a long kernel with parameters that vary: LLVM gives up on loops that are too long."""
        if not isinstance(statement, ast.Expr) or statement.value.func.id not in self._long:
            return False
        return not self._varying.isdisjoint(_names(statement))

    def _decision(self, statement: ast.If) -> list[str]:
        if _looks(statement):
            return self._watch(statement)
        inner = ["break"] if _ends(statement) else self._block(statement.body)
        return [f"if {ast.unparse(statement.test)}:", *_indented(inner)]

    def _group(self, group: Sequence[ast.stmt]) -> list[str]:
        """Kernels and copies for one lane after the other, on vectors that are loaded before and stored after them."""
        if not group:
            return []
        used = list(dict.fromkeys(name for statement in group for name in _names_in_order(statement)))
        lines = [f"{name} = {self._views[name]}" for name in used if name in self._views]
        kept = [name for name in used if name in self._sizes and name not in self._own]
        for name in kept:
            lines.append(f"copied(column(lanes_{name}, lane), 0, {self._sizes[name]}, {name}, 0)")
        for statement in group:
            lines += self._elements(statement, {}) if isinstance(statement, ast.For) else [ast.unparse(statement)]
        for name in dict.fromkeys(name for statement in group for name in _written(statement)):
            if name in kept:
                lines.append(f"copied({name}, 0, {self._sizes[name]}, column(lanes_{name}, lane), 0)")
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


class _Loops(ast.NodeTransformer):
    """Writes copies as loops over their elements: those of all lanes are no vectors."""

    def visit_Expr(self, node):
        if not isinstance(node.value, ast.Call) or node.value.func.id != "copied":
            return node
        source, first, size, target, at = node.value.args
        copied = f"{_element(target, at)} = {_element(source, first)}"
        return ast.parse(f"for i in range({ast.unparse(size)}):\n    {copied}").body[0]


def _element(vector, start) -> str:
    """The text of element `i` from `start` on, of a vector or of a row of a matrix."""
    at = f"{start.value} + i" if start.value else "i"
    if isinstance(vector, ast.Name):
        return f"{vector.id}[{at}]"
    rows, number = vector.args  # row(rows, number)
    return f"{rows.id}[{ast.unparse(number)}, {at}]"


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


def _ends(decision: ast.If) -> bool:
    """Whether it ends the rollout at the last tick."""
    return isinstance(decision.body[0], ast.Break)


def _looks(decision: ast.If) -> bool:
    """Whether it looks for a state that is no number."""
    return "finite" in _names(decision)


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
