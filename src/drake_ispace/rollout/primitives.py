"""Drake's own primitives as Specs, so that a compiled rollout knows only one kind of block."""

import functools
import hashlib

import numba
import numpy as np
from pydrake.systems.framework import Context, LeafSystem
from pydrake.systems.primitives import (
    Adder,
    ConstantVectorSource,
    Demultiplexer,
    DiscreteTimeDelay,
    Gain,
    MatrixGain,
    Multiplexer,
    Saturation,
    ZeroOrderHold,
)

from drake_ispace.blocks.block import Output, Phase, Spec, Update
from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.kernels import jit_options
from drake_ispace.blocks.rates import TICK_S


@functools.cache
def _kernel(text: str):
    """A kernel from its text: the argument names of a primitive's kernels are the names of its ports."""
    namespace = {}
    exec(text, {"__name__": "drake"}, namespace)
    (function,) = namespace.values()
    compiled = numba.njit(**jit_options(function))(function)
    compiled.digest, compiled.text = hashlib.sha256(text.encode()).hexdigest(), text
    return compiled


def specification(system: LeafSystem, context: Context, where: str) -> Spec:
    """The Spec of one of Drake's primitives.

    Args:
        system: a leaf that is no Block; context: its own, for parameters and state; where: its path, for messages.

    Raises:
        InputError: a system that a compiled rollout does not know, or a period that is no whole number of ticks.
    """
    ins = [system.get_input_port(i) for i in range(system.num_input_ports())]
    outs = [system.get_output_port(i) for i in range(system.num_output_ports())]
    inputs = {port.get_name(): port.size() for port in ins}
    for kind, make in _MAKERS.items():
        if isinstance(system, kind):
            return make(system, context, inputs, {port.get_name(): port.size() for port in outs}, where)
    raise InputError(
        f"{where} is a {type(system).__name__}, which a compiled rollout does not know; expected Blocks and Drake's "
        f"{', '.join(kind.__name__ for kind in _MAKERS)}"
    )


def _stateless(inputs, outputs, line, parameters=None):
    """One output whose kernel runs `line`, which may use `{0}`, `{1}`, ... for the inputs."""
    ((name, size),) = outputs.items()
    arguments = ", ".join([*inputs, *(parameters or {}), "out"])
    text = f"def output({arguments}):\n{line.format(*inputs)}\n"
    return Spec(inputs=inputs, outputs={name: Output(size, _kernel(text))}, parameters=parameters or {})


def _constant(system, context, inputs, outputs, where):
    value = context.get_numeric_parameter(0).CopyToVector()
    return _stateless(inputs, outputs, "    out[:] = value", {"value": value})


def _adder(system, context, inputs, outputs, where):
    lines = ["    out[:] = 0.0", *(f"    out[:] = out + {name}" for name in inputs)]
    return _stateless(inputs, outputs, "\n".join(lines))


def _multiplexer(system, context, inputs, outputs, where):
    lines, start = [], 0
    for name, size in inputs.items():
        lines.append(f"    out[{start}:{start + size}] = {name}")
        start += size
    return _stateless(inputs, outputs, "\n".join(lines))


def _demultiplexer(system, context, inputs, outputs, where):
    (source,) = inputs
    parts, start = {}, 0
    for name, size in outputs.items():
        text = f"def output({source}, out):\n    out[:] = {source}[{start}:{start + size}]\n"
        parts[name] = Output(size, _kernel(text))
        start += size
    return Spec(inputs=inputs, outputs=parts)


def _gain(system, context, inputs, outputs, where):
    (size,) = inputs.values()
    k = _evaluate(system, np.ones(size))
    return _stateless(inputs, outputs, "    out[:] = k * {0}", {"k": k})


def _matrix_gain(system, context, inputs, outputs, where):
    """Drake multiplies through Eigen, whose order of additions may differ in the last bit."""
    (size,) = inputs.values()
    d = np.column_stack([_evaluate(system, column) for column in np.eye(size)])
    line = (
        "    n = {0}.shape[0]\n    for i in range(out.shape[0]):\n        total = 0.0\n"
        "        for j in range(n):\n            total += d[n * i + j] * {0}[j]\n        out[i] = total"
    )
    return _stateless(inputs, outputs, line, {"d": d.ravel()})


def _saturation(system, context, inputs, outputs, where):
    if len(inputs) > 1:
        raise InputError(f"{where}: a compiled rollout knows no limits that come through ports, expected constants")
    (size,) = inputs.values()
    lower, upper = (_evaluate(system, np.full(size, extreme)) for extreme in (-np.inf, np.inf))
    return _stateless(
        inputs, outputs,
        "    for i in range(out.shape[0]):\n        out[i] = min(max({0}[i], lower[i]), upper[i])",
        {"lower": lower, "upper": upper},
    )


def _hold(system, context, inputs, outputs, where):
    (source,) = inputs
    return _sampled(system, context, inputs, outputs, where, f"def update({source}, out):\n    out[:] = {source}\n")


def _delay(system, context, inputs, outputs, where):
    """The state is a queue, oldest sample first."""
    (source,) = inputs
    lines = [f"n = {source}.shape[0]", "out[:-n] = xd[n:]", f"out[-n:] = {source}"]
    text = f"def update(xd, {source}, out):\n" + "".join(f"    {line}\n" for line in lines)
    return _sampled(system, context, inputs, outputs, where, text)


def _sampled(system, context, inputs, outputs, where, update):
    ((name, size),) = outputs.items()
    attributes = system.GetUniquePeriodicDiscreteUpdateAttribute()
    ticks = [attributes.period_sec() / TICK_S, attributes.offset_sec() / TICK_S]
    if any(value != round(value) for value in ticks):
        raise InputError(
            f"{where}: period {attributes.period_sec():g} s, offset {attributes.offset_sec():g} s; expected whole "
            f"multiples of the tick, rates.TICK_S = {TICK_S!r} s"
        )
    period, offset = map(round, ticks)
    return Spec(
        inputs=inputs,
        outputs={name: Output(size, _kernel("def output(xd, out):\n    out[:] = xd[: out.shape[0]]\n"))},
        discrete_state=context.get_discrete_state_vector().CopyToVector(),
        updates=(Update(_kernel(update), Phase.COMPUTE, period, offset),),
    )


def _evaluate(system, value):
    """The output of a memoryless system for the input `value`."""
    context = system.CreateDefaultContext()
    system.get_input_port(0).FixValue(context, value)
    return system.get_output_port(0).Eval(context).copy()


_MAKERS = {
    ZeroOrderHold: _hold, Gain: _gain, MatrixGain: _matrix_gain, Adder: _adder, Multiplexer: _multiplexer,
    Demultiplexer: _demultiplexer, ConstantVectorSource: _constant, Saturation: _saturation, DiscreteTimeDelay: _delay,
}
