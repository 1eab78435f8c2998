"""Block: a LeafSystem whose maths are pure functions ("kernels").

A kernel is a module-level function that reads floats and float arrays and writes its last argument, `out`, only. **Its
argument names are its wiring**: `xc` and `xd` are the block's continuous and discrete state, `tick` is the number of
the tick, and every other name is one of the block's input ports or parameters. Direct feed-through and cache
dependencies follow from the names, so nothing is declared twice.

The same kernel runs compiled in Drake's Simulator and, in its plain Python form, with AutoDiffXd and Expression, so
that `Linearize` works on a plant.
"""

import builtins
import dis
import enum
import functools
import hashlib
import inspect
import os
import stat
import tempfile
import threading
import types
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numba
import numpy as np
from numba.core.dispatcher import Dispatcher
from pydrake.common.value import AbstractValue
from pydrake.symbolic import Expression
from pydrake.systems.framework import BasicVector_, InputPortIndex, LeafSystem_, ValueProducer
from pydrake.systems.scalar_conversion import TemplateSystem

from drake_ispace.rates import TICK_S, tick_at


class Phase(enum.Enum):
    """When within an instant an update acts. Drake runs unrestricted updates first and discrete updates second, each
    on the state before it: sensors sample in the first phase, controllers compute in the second."""

    SENSE = "sense"
    COMPUTE = "compute"


@dataclass(frozen=True)
class Update:
    """A periodic update x_d <- kernel(...).

    With `through`, the block's outputs see the state *after* this update and the sample just taken (direct
    feed-through), and the update stores the same state. Such a kernel must change nothing when it meets the stamp of a
    sample for the second time, or its block would act once more on x_d after the update of the same instant.
    """

    kernel: Callable
    phase: Phase
    period_ticks: int = 1
    offset_ticks: int = 0
    through: bool = False


@dataclass(frozen=True)
class Output:
    """An output port of `size` floats, written by `kernel`."""

    size: int
    kernel: Callable


@dataclass(frozen=True)
class Spec:
    """Everything that a Block is made of.

    Parameters are floats, vectors, or mappings of floats (a group, which a kernel receives as one vector in the order
    of the mapping). They live in the Context as one numeric parameter vector named by `parameter_names`.
    """

    inputs: Mapping[str, int] = field(default_factory=dict)
    outputs: Mapping[str, Output] = field(default_factory=dict)
    parameters: Mapping[str, object] = field(default_factory=dict)
    continuous_state: np.ndarray | None = None
    derivatives: Callable | None = None
    discrete_state: np.ndarray | None = None
    updates: tuple[Update, ...] = ()
    #: Name of the random stream whose key is the parameter `noise_stream` (noise.py).
    noise_stream: str | None = None

    @property
    def parameter_names(self) -> list[str]:
        """One name per float: `mass_kg`, `radius_m[2]`, `slip.sx`."""
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
        """The floats that `parameter_names` names."""
        parts = [np.atleast_1d(np.asarray(_values(value), dtype=float)) for value in self.parameters.values()]
        return np.concatenate(parts) if parts else np.empty(0)


def _values(value):
    return list(value.values()) if isinstance(value, Mapping) else value


_SMALL_BYTES = 150  # of byte code
_MODULES = ("numpy", "math")  # what a kernel may reach into; their functions do not change between two runs
_cache_dir = threading.Lock()


def kernel(function: Callable | None = None, *, nogil: bool = False) -> Dispatcher:
    """Compile `function` with numba, cached on disk under a hash of its source, its constants and its helpers.

    nogil: other threads run meanwhile, for a kernel that takes long and is called from Python.

    Raises:
        TypeError: a function inside another one, one that reaches into a module other than NumPy, or a name that is not
            defined above it.
    """
    if function is None:
        return functools.partial(kernel, nogil=nogil)
    options = jit_options(function) | {"nogil": nogil}
    digest, text, folder = _digest(function, options), _text(function), cache_folder()
    kept = text is not None and folder is not None  # numba keeps nothing that has no file
    compiled = jitted(function, folder / digest[:16] if kept else None, **options)
    compiled.digest, compiled.text = digest, text
    return compiled


def text_of(compiled: Dispatcher) -> str | None:
    """The source of a kernel or of a helper that numba.njit made, None where there is none."""
    return compiled.text if hasattr(compiled, "text") else _text(compiled.py_func)


def jitted(function: Callable, folder: Path | None, **options) -> Dispatcher:
    """numba.njit, the machine code kept in `folder` (None: nowhere), which numba takes from a global variable."""
    if folder is None:
        return numba.njit(**options)(function)
    with _cache_dir:
        saved = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = str(folder)
        try:
            return numba.njit(cache=True, **options)(function)
        finally:
            numba.config.CACHE_DIR = saved


def _text(function: Callable) -> str | None:
    """The source, None where there is none (a prompt, `python -c`)."""
    try:
        return inspect.getsource(function)
    except (OSError, TypeError):
        return None


def _digest(function: Callable, options: Mapping | None = None) -> str:
    """A hash of all that a function computes with."""
    name = function.__qualname__
    if function.__closure__:
        raise TypeError(f"{name} uses variables of the function around it, expected a module-level function as kernel")
    parts = [str(options), _text(function) or _described_code(function.__code__)]
    parts += [_described(value, name) for value in (function.__defaults__, function.__kwdefaults__)]
    for used in sorted(set(_global_names(function.__code__)) - {function.__name__}):
        if used in function.__globals__:
            parts.append(f"{used}={_described(function.__globals__[used], name, used)}")
        elif not hasattr(builtins, used):
            raise TypeError(f"{name} uses {used}, which is not defined yet, expected it above the kernel")
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def _described(value, where: str, name: str = "") -> str:
    """A text that changes with the value, and only with it."""
    if isinstance(value, types.ModuleType):
        if value.__name__.partition(".")[0] not in _MODULES:
            raise TypeError(f"{where} reaches into the module {name}, expected the name itself to be imported from it")
        return value.__name__
    if isinstance(value, Dispatcher):
        return getattr(value, "digest", None) or _digest(value.py_func, value.targetoptions)
    if callable(value) and str(getattr(value, "__module__", "")).partition(".")[0] in _MODULES:
        return f"{value.__module__}.{value.__name__}"
    if isinstance(value, types.FunctionType):
        return _digest(value)
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape} {hashlib.sha256(value.tobytes()).hexdigest()}"
    if isinstance(value, tuple):
        return f"({', '.join(_described(item, where) for item in value)})"
    return repr(value)


def _described_code(code: types.CodeType) -> str:
    constants = [_described_code(c) if isinstance(c, types.CodeType) else repr(c) for c in code.co_consts]
    return f"{code.co_code.hex()} {code.co_names} {code.co_varnames} {constants}"


def _global_names(code: types.CodeType) -> Iterator[str]:
    """The global names that a function, or one inside it, reads."""
    yield from (step.argval for step in dis.get_instructions(code) if step.opname == "LOAD_GLOBAL")
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _global_names(constant)


def jit_options(function: Callable) -> dict:
    """How numba compiles a kernel: it becomes a part of every compiled rollout that uses it.

    Small ones, most of which only copy, are inlined before LLVM sees them. On its own such a loop becomes a vectorised
    loop that checks for overlap, a form from which inlining later cannot return. For large ones that takes too long.
    """
    inline = "always" if len(function.__code__.co_code) < _SMALL_BYTES else "never"
    return {"error_model": "numpy", "forceinline": True, "inline": inline}


def cache_folder() -> Path | None:
    """$DRAKE_ISPACE_CACHE, else the user's cache folder, else (where neither can be written) a temporary one of this
    user alone; None where nothing can be written."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    folder = Path(os.environ.get("DRAKE_ISPACE_CACHE") or Path(base) / "drake_ispace")
    if _writable(folder):
        return folder
    folder = Path(tempfile.gettempdir()) / f"drake_ispace-{os.getuid()}"
    return folder if _writable(folder) and _private(folder) else None


def _writable(folder):
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    except OSError:
        return False
    return os.access(folder, os.W_OK | os.X_OK)


def _private(folder):
    """Whether nobody else can have put machine code there."""
    found = folder.lstat()
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o022


@kernel
def copy(source, out):
    """out <- the first entries of source. A slice assignment would check for overlap every time."""
    for i in range(out.shape[0]):
        out[i] = source[i]


def plain(compiled: Callable) -> Callable:
    """The plain Python form of a kernel, its helper kernels included: it takes AutoDiffXd and Expression too."""
    if not isinstance(compiled, Dispatcher):
        return compiled
    function = compiled.py_func
    wanted = {"__builtins__", *_global_names(function.__code__)}
    names = {
        name: plain(value) if isinstance(value, Dispatcher) else value for name, value in function.__globals__.items()
        if name in wanted
    }
    return types.FunctionType(function.__code__, names, function.__name__, function.__defaults__)


def arguments(function: Callable) -> list[str]:
    """The names of a kernel's arguments, `out` left away."""
    return list(inspect.signature(getattr(function, "py_func", function)).parameters)[:-1]


_EMPTY = np.empty(0)


@TemplateSystem.define("Block_")
def Block_(T):
    scalar_is_float = T is float

    class Impl(LeafSystem_[T]):
        """A LeafSystem made of kernels; see the module."""

        def _construct(self, spec: Spec, converter=None):
            LeafSystem_[T].__init__(self, converter=converter)
            self.spec = spec
            self._through = None
            for name, size in spec.inputs.items():
                self.DeclareVectorInputPort(name, size)
            self.DeclareNumericParameter(BasicVector_[T](spec.parameter_values))
            self._parameters = self._declare_cache("parameters", self._unpack, {self.all_parameters_ticket()})
            if spec.continuous_state is not None:
                self.DeclareContinuousState(BasicVector_[T](np.asarray(spec.continuous_state, dtype=float)))
                self._derivatives = self._bind(spec.derivatives)
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
            step = self._bind(update.kernel)
            size = len(self.spec.discrete_state)
            period_s, offset_s = update.period_ticks * TICK_S, update.offset_ticks * TICK_S
            if update.through:
                if update.phase is not Phase.COMPUTE or len(self.spec.updates) > 1:
                    raise ValueError("a through update is its block's only update, in the compute phase")
                tickets = self._tickets(update.kernel)
                self._through = self._declare_cache("stepped", lambda context: step(context, size), tickets)

            def sense(context, state):
                # Updates of one block that fall on the same instant act one after the other, in the order declared.
                stored = state.get_mutable_discrete_state()
                stored.set_value(step(context, size, stored.value().copy()))

            def compute(context, stored):
                stored.set_value(self._through.Eval(context) if update.through else step(context, size))

            if update.phase is Phase.SENSE:
                self.DeclarePeriodicUnrestrictedUpdateEvent(period_s, offset_s, sense)
            else:
                self.DeclarePeriodicDiscreteUpdateEvent(period_s, offset_s, compute)

        def _declare_output(self, name, output: Output):
            calc = self._bind(output.kernel, stepped=self._through is not None)

            def write(context, vector):
                vector.SetFromVector(calc(context, output.size))

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
            """Parameter name -> float or vector, as kernels take them."""
            flat, unpacked, start = context.get_numeric_parameter(0).CopyToVector(), {}, 0
            if T is Expression:  # kernels branch on parameters, and a Formula has no truth value
                flat = np.array([e if e.GetVariables().size() else e.Evaluate() for e in flat], dtype=object)
            for name, value in self.spec.parameters.items():
                size = np.size(_values(value))
                is_scalar = np.ndim(_values(value)) == 0
                unpacked[name] = flat[start] if is_scalar else flat[start : start + size]
                start += size
            return unpacked

        def _bind(self, function, stepped=False):
            """A function (context, size of out, x_d to use instead of the stored one) -> out."""
            run = function if scalar_is_float else plain(function)
            names = arguments(function)
            known = {"xc", "xd", "tick", *self.spec.inputs, *self.spec.parameters}
            if unknown := set(names) - known:
                raise TypeError(f"{type(self).__name__}: kernel argument {unknown} is no port, state or parameter")
            dtype = float if scalar_is_float else object
            getters = [self._getter(name, stepped) for name in names]

            def call(context, size, xd=None):
                parameters = self._parameters.Eval(context)
                out = np.empty(size, dtype)
                run(*[get(context, parameters, xd) for get in getters], out)
                return out

            return call

        def _getter(self, name, stepped):
            """A function (context, parameters, x_d to use instead of the stored one) -> the argument called `name`."""
            if name in self.spec.inputs:
                index = list(self.spec.inputs).index(name)

                def get(context, parameters, xd):
                    vector = self.EvalVectorInput(context, index)
                    if vector is None:
                        raise RuntimeError(f"input port '{name}' of block '{self.get_name()}' is not connected")
                    return vector.CopyToVector()

                return get
            if name == "xd" and self.spec.discrete_state is None:
                return lambda context, parameters, xd: _EMPTY
            if name == "xd" and stepped:
                return lambda context, parameters, xd: self._through.Eval(context)
            if name == "xd":
                return lambda context, parameters, xd: (
                    context.get_discrete_state_vector().CopyToVector() if xd is None else xd
                )
            if name == "xc":
                return lambda context, parameters, xd: context.get_continuous_state_vector().CopyToVector()
            if name == "tick":
                return lambda context, parameters, xd: tick_at(float(context.get_time()))
            return lambda context, parameters, xd: parameters[name]

        def DoCalcTimeDerivatives(self, context, derivatives):
            if self.spec.derivatives is not None:
                size = len(self.spec.continuous_state)
                derivatives.get_mutable_vector().SetFromVector(self._derivatives(context, size))

    return Impl


#: A Block over floats; every box in a picture is a subclass of it.
Block = Block_[None]
