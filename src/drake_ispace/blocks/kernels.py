"""Kernels: the pure functions that a Block's maths are made of, compiled and cached, or taken as plain Python."""

import builtins
import dis
import functools
import hashlib
import inspect
import os
import stat
import tempfile
import threading
import types
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numba
import numpy as np
from numba.core.dispatcher import Dispatcher

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
        fields = getattr(value, "_fields", ("",) * len(value))  # of a named tuple, which a kernel reads by name
        return str([(field, _described(item, where)) for field, item in zip(fields, value, strict=True)])
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
