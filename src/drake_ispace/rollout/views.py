"""Float vectors whose size the compiler knows, for compiled rollouts.

A NumPy array made with np.zeros, or a slice of one, has a size that LLVM learns only when the function runs, and may
share its memory with any other. So loops over it stay loops, and every store forces every later load. A vector of
`local` lies on the stack under a constant size: once the kernels are inlined, LLVM unrolls their loops and keeps the
elements in registers, as it does for a fixed array in C.
"""

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.errors import RequireLiteralValue
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array

_CACHE_LINE = 64  # bytes, and the longest vector register; a store over the end of one takes twice as long
_VECTOR, _MATRIX = (types.Array(types.float64, dimensions, "C") for dimensions in (1, 2))
_COLUMN = types.Array(types.float64, 1, "A")


@intrinsic
def local(typing_context, size):
    """A vector of `size` zeros on the stack; `size`: a literal. It lives as long as the function that calls this."""
    count = _literal(size)

    def codegen(context, builder, signature, arguments):
        return _array(context, builder, _zeros(builder, count), count)

    return _VECTOR(size), codegen


@intrinsic
def matrix(typing_context, rows, columns):
    """Like `local`, (rows, columns) zeros."""
    shape = _literal(rows), _literal(columns)

    def codegen(context, builder, signature, arguments):
        return _array(context, builder, _zeros(builder, shape[0] * shape[1]), *shape)

    return _MATRIX(rows, columns), codegen


@intrinsic
def part(typing_context, vector, start, size):
    """vector[start:start + size]; `start`, `size`: literals that lie inside. It shares the memory of `vector`."""
    first, count = _literal(start), _literal(size)

    def codegen(context, builder, signature, arguments):
        source = make_array(_VECTOR)(context, builder, arguments[0])
        return _array(context, builder, cgutils.gep(builder, source.data, first), count)

    return _VECTOR(_VECTOR, start, size), codegen


@intrinsic
def row(typing_context, rows, number):
    """rows[number] of a matrix without gaps. It shares the memory of the matrix."""
    def codegen(context, builder, signature, arguments):
        matrix = make_array(_MATRIX)(context, builder, arguments[0])
        size = builder.extract_value(matrix.shape, 1)
        start = builder.mul(context.cast(builder, arguments[1], number, types.intp), size)
        return _array(context, builder, builder.gep(matrix.data, [start]), size)

    return _VECTOR(rows, number), codegen


@intrinsic
def column(typing_context, rows, number):
    """rows[:, number] of a matrix without gaps. It shares the memory of the matrix."""
    def codegen(context, builder, signature, arguments):
        matrix = make_array(_MATRIX)(context, builder, arguments[0])
        length, size = (builder.extract_value(matrix.shape, axis) for axis in (0, 1))
        data = builder.gep(matrix.data, [context.cast(builder, arguments[1], number, types.intp)])
        return _array(context, builder, data, length, kind=_COLUMN, step=size)

    return _COLUMN(rows, number), codegen


@intrinsic
def copied(typing_context, source, first, size, target, at):
    """target[at:at + size] = source[first:first + size]; `first`, `size`, `at`: literals. They share no memory.

    To numba a loop is ten statements, and a rollout has a hundred copies: a third of what it would take to compile.
    """
    start, count, place = _literal(first), _literal(size), _literal(at)

    def codegen(context, builder, signature, arguments):
        sources, targets = (_elements(context, builder, signature.args[n], arguments[n]) for n in (0, 3))
        with cgutils.for_range(builder, context.get_constant(types.intp, count)) as loop:
            builder.store(builder.load(sources(loop.index, start)), targets(loop.index, place))
        return context.get_dummy_value()

    return types.void(source, first, size, target, at), codegen


def _elements(context, builder, kind, vector):
    """A function (index, start) -> pointer to the element at the sum of both, of a vector or a column."""
    array = make_array(kind)(context, builder, vector)
    if kind != _COLUMN:
        return lambda index, start: builder.gep(cgutils.gep(builder, array.data, start), [index])
    step = builder.extract_value(array.strides, 0)
    moved = lambda index, start: builder.mul(builder.add(index, context.get_constant(types.intp, start)), step)  # noqa: E731
    return lambda index, start: cgutils.pointer_add(builder, array.data, moved(index, start))


def _literal(size):
    if not isinstance(size, types.IntegerLiteral):
        raise RequireLiteralValue("expected a literal size")
    return size.literal_value


def _zeros(builder, count):
    memory = cgutils.alloca_once(builder, ir.ArrayType(ir.DoubleType(), count), zfill=True)
    memory.align = _CACHE_LINE
    return builder.bitcast(memory, ir.DoubleType().as_pointer())


def _array(context, builder, data, *shape, kind=None, step=1):
    """An array of numba; shape and step (in floats, between elements of the last axis) are numbers, or known later."""
    known = lambda value: value if isinstance(value, ir.Value) else context.get_constant(types.intp, value)  # noqa: E731
    size = known(8)
    array = make_array(kind or (_VECTOR if len(shape) == 1 else _MATRIX))(context, builder)
    shape, strides = [known(length) for length in shape], [builder.mul(known(step), size)]
    for length in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], length))
    populate_array(array, data=data, shape=shape, strides=strides, itemsize=size, meminfo=None)
    return array._getvalue()
