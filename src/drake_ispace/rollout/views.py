"""Float vectors whose size the compiler knows, for compiled rollouts.

A NumPy array made with np.zeros, or a slice of one, has a size that LLVM learns only when the function runs, and may
share its memory with any other. So loops over it stay loops, and every store forces every later load. A vector of
`local` lies on the stack under a constant size: once the kernels are inlined, LLVM unrolls their loops and keeps the
elements in registers, as it does for a fixed array in C.
"""

import math

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.errors import RequireLiteralValue
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array

_CACHE_LINE = 64  # bytes, and the longest vector register; a store over the end of one takes twice as long
_VECTOR, _MATRIX = (types.Array(types.float64, dimensions, "C") for dimensions in (1, 2))


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
    """rows[number] as a vector of rows (n, size) without gaps. It shares their memory."""
    def codegen(context, builder, signature, arguments):
        source = make_array(_MATRIX)(context, builder, arguments[0])
        size = builder.extract_value(source.shape, 1)
        start = builder.mul(context.cast(builder, arguments[1], number, types.intp), size)
        return _array(context, builder, cgutils.gep(builder, source.data, start), size)

    return _VECTOR(rows, number), codegen


@intrinsic
def copied(typing_context, source, first, size, target, at):
    """target[at:at + size] = source[first:first + size]; `first`, `size`, `at`: literals. They share no memory.

    To numba a loop is ten statements, and a rollout has a hundred copies: most of what it would take to compile.
    """
    start, count, place = _literal(first), _literal(size), _literal(at)

    def codegen(context, builder, signature, arguments):
        source, target = (make_array(_VECTOR)(context, builder, arguments[number]).data for number in (0, 3))
        begin, end = cgutils.gep(builder, target, place), cgutils.gep(builder, source, start)
        cgutils.memcpy(builder, begin, end, context.get_constant(types.intp, count))
        return context.get_dummy_value()

    return types.void(source, first, size, target, at), codegen


def _literal(size):
    if not isinstance(size, types.IntegerLiteral):
        raise RequireLiteralValue("expected a literal size")
    return size.literal_value


def _zeros(builder, count):
    memory = cgutils.alloca_once(builder, ir.ArrayType(ir.DoubleType(), count), zfill=True)
    memory.align = _CACHE_LINE
    return builder.bitcast(memory, ir.DoubleType().as_pointer())


def _array(context, builder, data, *shape):
    array = make_array(_VECTOR if len(shape) == 1 else _MATRIX)(context, builder)
    size = 8
    strides = [size * int(math.prod(shape[axis + 1 :])) for axis in range(len(shape))]
    known = lambda value: value if isinstance(value, ir.Value) else context.get_constant(types.intp, value)  # noqa: E731
    integer = lambda values: [known(value) for value in values]  # noqa: E731
    populate_array(
        array, data=data, shape=integer(shape), strides=integer(strides), itemsize=integer([size])[0], meminfo=None,
    )
    return array._getvalue()
