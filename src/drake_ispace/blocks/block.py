"""Block: a LeafSystem whose equations are pure functions ("kernels").

The kernel of an update, an output or a derivative is a module-level function. It reads floats and float arrays, and
writes only to its last argument, `out`. **Its argument names are its wiring**: `xc` and `xd` are the block's
continuous and discrete state, `tick` is the number of the tick, and every other name is an input port or a parameter
of the block. Direct feed-through and cache dependencies follow from the names, so nothing is declared twice.

The same kernel runs compiled in Drake's Simulator and, in its plain Python form, with AutoDiffXd and Expression.
`Linearize` therefore works on a plant.
"""

import enum
import functools
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.symbolic import Expression
from pydrake.systems.framework import (
    BasicVector_,
    Context,
    Diagram,
    InputPortIndex,
    LeafSystem_,
    System,
    ValueProducer,
)
from pydrake.systems.scalar_conversion import TemplateSystem

from drake_ispace.blocks.kernels import arguments, plain
from drake_ispace.blocks.rates import TICK_S, tick_at


class Phase(enum.Enum):
    """When an update acts within an instant: sensors sample in the first phase, controllers compute in the second.

    SENSE is an unrestricted update and COMPUTE a discrete update. Drake runs all unrestricted updates first; the
    discrete updates then see the state that the unrestricted ones have left.
    """

    SENSE = "sense"
    COMPUTE = "compute"


@dataclass(frozen=True)
class Update:
    """A periodic update x_d <- kernel(...).

    The period and the offset are in ticks. With `through`, the block's outputs already see the state *after* this
    update (direct feed-through from the inputs of the update), and the update stores that same state. The outputs are
    evaluated again after the update has been stored. The kernel must therefore leave x_d unchanged when the tick of
    its sample is the one stored in x_d, or a sample would act twice.

    With `in_place`, the kernel gives the same numbers where x_d and what it writes are one vector: a long memory of
    which little changes need not be copied. It does not go with `through`.
    """

    kernel: Callable
    phase: Phase
    period_ticks: int = 1
    offset_ticks: int = 0
    through: bool = False
    in_place: bool = False


@dataclass(frozen=True)
class Output:
    """An output port of `size` floats, written by `kernel`."""

    size: int
    kernel: Callable


@dataclass(frozen=True)
class Spec:
    """The ports, parameters, states and updates of a Block.

    `inputs` maps the name of each input port to its size. A parameter is a float, a vector, or a group: a mapping of
    floats that a kernel receives as one vector in the order of the mapping. The Context holds all parameters in one
    numeric parameter vector, whose entries `parameter_names` names.
    """

    inputs: Mapping[str, int] = field(default_factory=dict)
    outputs: Mapping[str, Output] = field(default_factory=dict)
    parameters: Mapping[str, object] = field(default_factory=dict)
    continuous_state: np.ndarray | None = None
    derivatives: Callable | None = None
    discrete_state: np.ndarray | None = None
    updates: tuple[Update, ...] = ()
    #: Name of the random stream whose key is the parameter `noise_stream`; None for a block without noise.
    noise_stream: str | None = None

    @property
    def parameter_names(self) -> list[str]:
        """One name per float: `mass_kg`, `radius_m[2]`, `slip.lever_m`."""
        names = []
        for name, value in self.parameters.items():
            if isinstance(value, Mapping):
                names += [f"{name}.{key}" for key in value]
            elif np.ndim(value) == 0:
                names.append(name)
            else:
                names += [f"{name}[{i}]" for i in range(len(value))]
        return names

    @property
    def parameter_values(self) -> np.ndarray:
        """The parameters as one vector, in the order of `parameter_names`."""
        parts = [np.atleast_1d(np.asarray(_values(value), dtype=float)) for value in self.parameters.values()]
        return np.concatenate(parts) if parts else np.empty(0)


def _values(value):
    return list(value.values()) if isinstance(value, Mapping) else value


#: What a Block keeps of no Context: the Context, its continuous and discrete state, and its parameters by name.
_NOTHING_KEPT = None, np.empty(0), np.empty(0), {}


@functools.cache
def _with_derivatives(blocks: type) -> type:
    """Return the subclass of a class of blocks that computes derivatives.

    Drake asks every block that overrides DoCalcTimeDerivatives three times a step, also those without continuous
    state, and each call of Python costs a microsecond.
    """

    def calculate(self, context, derivatives):
        derivatives.SetFromVector(self._derivatives(context))

    inherited = {"__module__": blocks.__module__, "__qualname__": blocks.__qualname__, "__doc__": blocks.__doc__}
    return type(blocks.__name__, (blocks,), {"DoCalcTimeDerivatives": calculate, **inherited})


@TemplateSystem.define("Block_")
def Block_(T):
    scalar_is_float = T is float

    class Impl(LeafSystem_[T]):
        """A LeafSystem over the scalar type T whose equations are kernels."""

        def _construct(self, spec: Spec, converter=None):
            LeafSystem_[T].__init__(self, converter=converter)
            self.spec = spec
            self._through = None
            self._kept = _NOTHING_KEPT
            for name, size in spec.inputs.items():
                self.DeclareVectorInputPort(name, size)
            self.DeclareNumericParameter(BasicVector_[T](spec.parameter_values))
            self._unpacked = []  # the first two that were needed; while there is one, no Context has others
            self._parameters = self._declare_cache("parameters", self._unpack, {self.all_parameters_ticket()})
            if spec.continuous_state is not None:
                self.DeclareContinuousState(BasicVector_[T](np.asarray(spec.continuous_state, dtype=float)))
                self._derivatives = self._bind(spec.derivatives, len(spec.continuous_state))
                self.__class__ = _with_derivatives(type(self))
            if spec.discrete_state is not None:
                self.DeclareDiscreteState(BasicVector_[T](np.asarray(spec.discrete_state, dtype=float)))
            if sum(update.phase is Phase.COMPUTE for update in spec.updates) > 1:
                raise ValueError("a block has at most one update in the compute phase, where each sees the old state")
            for update in spec.updates:
                self._declare_update(update)
            for name, output in spec.outputs.items():
                self._declare_output(name, output)

        def _construct_copy(self, other, converter=None):
            Impl._construct(self, other.spec, converter=converter)

        def _declare_cache(self, description, calc, prerequisites):
            def calculate(context, value):
                value.set_value(calc(context))

            producer = ValueProducer(allocate=lambda: AbstractValue.Make(object()), calc=calculate)
            return self.DeclareCacheEntry(description, producer, prerequisites)

        def _declare_update(self, update: Update):
            size = len(self.spec.discrete_state)
            period_s, offset_s = update.period_ticks * TICK_S, update.offset_ticks * TICK_S
            if update.through:
                if update.phase is not Phase.COMPUTE or len(self.spec.updates) > 1:
                    raise ValueError("a through update is its block's only update, in the compute phase")
                step = self._bind(update.kernel, size)
                self._through = self._declare_cache("stepped", step, self._tickets(update.kernel))

                def compute(context, stored):
                    stored.set_value(self._through.Eval(context))

                self.DeclarePeriodicDiscreteUpdateEvent(period_s, offset_s, compute)
            elif update.phase is Phase.COMPUTE:
                compute = self._bind(update.kernel, size, writes=True)
                self.DeclarePeriodicDiscreteUpdateEvent(period_s, offset_s, compute)
            else:
                step = self._bind(update.kernel, size)

                def sense(context, state):
                    # Sense updates of one block at the same instant act one after the other, in the order declared.
                    stored = state.get_mutable_discrete_state()
                    stored.set_value(step(context, stored.value().copy()))

                self.DeclarePeriodicUnrestrictedUpdateEvent(period_s, offset_s, sense)

        def _declare_output(self, name, output: Output):
            write = self._bind(output.kernel, output.size, stepped=self._through is not None, writes=True)
            self.DeclareVectorOutputPort(name, output.size, write, self._tickets(output.kernel, stepped=True))

        def _tickets(self, function, stepped=False):
            tickets = set()
            for name in arguments(function):
                if name in self.spec.inputs:
                    tickets.add(self.input_port_ticket(InputPortIndex(list(self.spec.inputs).index(name))))
                elif name == "xd" and stepped and self._through is not None:
                    tickets.add(self.cache_entry_ticket(self._through.cache_index()))
                elif name in ("xd", "xc", "tick"):
                    tickets.add({"xd": self.xd_ticket, "xc": self.xc_ticket, "tick": self.time_ticket}[name]())
                else:
                    tickets.add(self.all_parameters_ticket())
            return tickets or {self.nothing_ticket()}

        def _unpack(self, context):
            """Return the parameters by name, each as the float or vector that a kernel receives."""
            flat, unpacked, start = context.get_numeric_parameter(0).CopyToVector(), {}, 0
            if T is Expression:  # kernels branch on parameters, and a Formula has no truth value
                flat = np.array([e if e.GetVariables().size() else e.Evaluate() for e in flat], dtype=object)
            for name, value in self.spec.parameters.items():
                size = np.size(_values(value))
                is_scalar = np.ndim(_values(value)) == 0
                # a float of Python's is passed on to a kernel faster than NumPy's
                unpacked[name] = flat.item(start) if is_scalar else flat[start : start + size]
                start += size
            if len(self._unpacked) < 2:
                self._unpacked.append(unpacked)
            return unpacked

        def _keep(self, context):
            """Keep the objects of the block's own Context, or those of none; see `in_one_context`."""
            if context is None:
                self._kept = _NOTHING_KEPT
                return
            has_xc, has_xd = context.num_continuous_states(), context.num_discrete_state_groups()
            xc = context.get_continuous_state_vector().value() if has_xc else _NOTHING_KEPT[1]
            xd = context.get_discrete_state_vector().value() if has_xd else _NOTHING_KEPT[2]
            self._kept = context, xc, xd, self._parameters.Eval(context)

        def _bind(self, function, size, stepped=False, writes=False):
            """Return a function (context, given=None) that evaluates a kernel into a new `out` of `size` entries.

            A second argument takes the place of the discrete state stored in the context. With `stepped`, the argument
            `xd` of a block with a through update is the state after that update. With `writes`, the function is
            (context, vector) and evaluates it into the vector or the DiscreteValues that Drake asks for, in place where
            these are floats.

            The function is made from its text: a call of Python for every argument would make Drake's Simulator
            slower by a seventh. What `in_one_context` keeps is not fetched again. Nor are parameters that are the same
            in every Context so far: to ask whether they are there takes a third of the time.

            Raises:
                TypeError: an argument of the kernel is no port, state or parameter.
            """
            names = arguments(function)
            known = {"xc", "xd", "tick", *self.spec.inputs, *self.spec.parameters}
            if unknown := set(names) - known:
                raise TypeError(f"{type(self).__name__}: kernel argument {unknown} is no port, state or parameter")
            ports = {f"port_{name}": self.get_input_port(i).Eval for i, name in enumerate(self.spec.inputs)}
            values = "value()" if scalar_is_float else "CopyToVector()"
            fetched = {
                "xc": f"context.get_continuous_state_vector().{values}",
                "xd": f"context.get_discrete_state_vector().{values}",
                "parameters": "unpacked[0] if len(unpacked) == 1 and not out_of_date(context) else unpack(context)",
            }
            needed = {"parameters" if name in self.spec.parameters else name for name in names}
            if stepped or self.spec.discrete_state is None:
                needed.discard("xd")
            texts = {
                **{name: f"parameters[{name!r}]" for name in self.spec.parameters},
                "xc": "xc", "xd": "xd", "tick": "tick_at(float(context.get_time()))",
                **{name: f"port_{name}(context)" for name in self.spec.inputs},
            }
            if stepped:
                texts["xd"] = "stepped(context)"
            in_place = writes and scalar_is_float
            lines = [
                "def call(context, vector):" if writes else "def call(context, given=None):",
                "out = vector.get_mutable_value()" if in_place else "out = empty(size, scalar)",
                "kept, xc, xd, parameters = block._kept",
            ]
            if of_context := [f"    {name} = {text}" for name, text in fetched.items() if name in needed]:
                lines += ["if context is not kept:", *of_context]
            if "xd" in needed and not writes:
                lines += ["if given is not None:", "    xd = given"]
            lines += [f"run({', '.join([*(texts[name] for name in names), 'out'])})"]
            if not in_place:
                lines += ["vector.set_value(out)" if writes else "return out"]
            scope = {
                "run": function if scalar_is_float else plain(function), "scalar": float if scalar_is_float else object,
                "empty": np.empty, "size": size, "tick_at": tick_at, "block": self, "unpacked": self._unpacked,
                "out_of_date": self._parameters.is_out_of_date, "unpack": self._parameters.Eval,
                "stepped": self._through.Eval if stepped else None, **ports,
            }
            exec(compile("\n    ".join(lines), f"<arguments of {function.__name__}>", "exec"), scope)
            return scope["call"]

    return Impl


#: A Block over floats; every block of a diagram is a subclass of Block.
Block = Block_[None]


@contextmanager
def in_one_context(system: System, context: Context) -> Iterator[None]:
    """Simulate a Diagram in this one Context, of which no parameter changes meanwhile, and make it a sixth faster.

    Every Block keeps the Python objects of its Context, its state and its parameters, which pydrake otherwise makes
    anew for every call. Evaluations in other Contexts stay right.
    """
    blocks = [leaf for leaf in _leaves(system) if isinstance(leaf, Block)]
    try:
        for block in blocks:
            block._keep(block.GetMyContextFromRoot(context))
        yield
    finally:
        for block in blocks:
            block._keep(None)


def _leaves(system: System) -> Iterator[System]:
    if isinstance(system, Diagram):
        for part in system.GetSystems():
            yield from _leaves(part)
    else:
        yield system
