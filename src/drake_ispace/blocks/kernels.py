"""Kernels: the pure functions that hold a Block's equations, compiled and cached, or run as plain Python."""

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
from numba.core.extending import _Intrinsic

from drake_ispace.blocks import linking
from drake_ispace.blocks.errors import InputError

_SMALL_BYTES = 150  # of byte code
_MODULES = ("numpy", "math")  # modules that a kernel may use; their functions do not change between two runs
_LINKING = hashlib.sha256(inspect.getsource(linking).encode()).hexdigest()
_cache_dir = threading.Lock()


def kernel(
    function: Callable | None = None, *, nogil: bool = False, stands_for: Callable | None = None,
) -> Dispatcher:
    """Compile `function` with numba and cache the machine code on disk.

    The cache key is a hash of the function's module, source, global constants and helper functions: cached code asks
    for the module by its name.

    Args:
        function: a module-level function.
        nogil: release the GIL while the kernel runs, for a long computation that Python calls.
        stands_for: a function of NumPy that is the same mathematically, and takes the kernel's place in plain Python.

    Raises:
        TypeError: the function uses variables of an enclosing function, a module other than numpy and math, or a
            global name that is not defined yet.
    """
    if function is None:
        return functools.partial(kernel, nogil=nogil, stands_for=stands_for)
    options = jit_options(function) | {"nogil": nogil, "pipeline_class": linking.KernelCompiler}
    digest, text = _digest(function, options | {"linking": _LINKING}), _text(function)
    folder = None if text is None else cache_folder(digest[:16])  # numba keeps nothing that has no file
    compiled = jitted(function, folder, **options)
    compiled.digest, compiled.text, compiled.stands_for = digest, text, stands_for
    return compiled


def text_of(compiled: Dispatcher) -> str | None:
    """Return the source of a kernel or of another function compiled by numba, or None if there is no source file."""
    return compiled.text if hasattr(compiled, "text") else _text(compiled.py_func)


def jitted(function: Callable, folder: Path | None, **options) -> Dispatcher:
    """Compile `function` with numba.njit and keep the machine code in `folder`, or nowhere if `folder` is None."""
    if folder is None:
        return numba.njit(**options)(function)
    with _cache_dir:  # numba reads the folder from a global variable
        saved = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = str(folder)
        try:
            return numba.njit(cache=True, **options)(function)
        finally:
            numba.config.CACHE_DIR = saved


def _text(function: Callable) -> str | None:
    """Return the source of a function, or None if there is none (at a prompt, in `python -c`)."""
    try:
        return inspect.getsource(function)
    except (OSError, TypeError):
        return None


def _digest(function: Callable, options: Mapping | None = None) -> str:
    """Return a hash of everything that the result of a function depends on, except its arguments."""
    name = function.__qualname__
    if function.__closure__:
        raise TypeError(f"{name} uses variables of the function around it, expected a module-level function as kernel")
    parts = [str(options), str(function.__module__), _text(function) or _described_code(function.__code__)]
    parts += [_described(value, name) for value in (function.__defaults__, function.__kwdefaults__)]
    for used in sorted(set(_global_names(function.__code__)) - {function.__name__}):
        if used in function.__globals__:
            parts.append(f"{used}={_described(function.__globals__[used], name, used)}")
        elif not hasattr(builtins, used):
            raise TypeError(f"{name} uses {used}, which is not defined yet, expected it above the kernel")
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def _described(value, where: str, name: str = "") -> str:
    """Return a text that is the same in every run for the same value, and differs for different values.

    `where` is the function that uses the value, `name` the name of the value there; both are for error messages.
    """
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
    if isinstance(value, _Intrinsic):
        return inspect.getsource(value._defn)
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape} {hashlib.sha256(value.tobytes()).hexdigest()}"
    if isinstance(value, tuple):
        fields = getattr(value, "_fields", ("",) * len(value))  # a kernel reads a named tuple by its field names
        return str([(field, _described(item, where)) for field, item in zip(fields, value, strict=True)])
    return repr(value)


def _described_code(code: types.CodeType) -> str:
    constants = [_described_code(c) if isinstance(c, types.CodeType) else repr(c) for c in code.co_consts]
    return f"{code.co_code.hex()} {code.co_names} {code.co_varnames} {constants}"


def _global_names(code: types.CodeType) -> Iterator[str]:
    """Yield the global names that a function, or a function nested in it, reads."""
    yield from (step.argval for step in dis.get_instructions(code) if step.opname == "LOAD_GLOBAL")
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _global_names(constant)


def is_small(function: Callable) -> bool:
    """Return whether a function is so short that it most likely only copies."""
    return len(function.__code__.co_code) < _SMALL_BYTES


def jit_options(function: Callable) -> dict:
    """Return the numba options for a kernel, which becomes part of every compiled rollout that uses it.

    Small functions, most of which only copy, are inlined before LLVM sees them. Compiled on its own, a copying loop
    becomes a vectorised loop with checks for overlap, and inlining cannot undo that later. Large ones are left to
    LLVM, because inlining them in numba takes too long; it gets them as linking.py keeps them.
    """
    inline = "always" if is_small(function) else "never"
    return {"error_model": "numpy", "forceinline": True, "inline": inline}


def cache_folder(part: str = "") -> Path | None:
    """Return the folder for compiled kernels or a folder in it, or None if none can be written by this user alone.

    The folder is $DRAKE_ISPACE_CACHE, or drake_ispace in the user's cache folder if that variable is not set. If this
    folder cannot be written, or others may write there, a temporary folder takes its place: what lies there is run.

    Raises:
        InputError: others may write to the folder that the variable names.
    """
    given = os.environ.get("DRAKE_ISPACE_CACHE")
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    temporary = Path(tempfile.gettempdir()) / f"drake_ispace-{os.getuid()}"
    own = Path(os.path.realpath(given or Path(base) / "drake_ispace"))  # the user's own folder may be a link
    for folder in (own, temporary):
        if not _writable(folder):
            continue
        if _private(folder):
            return folder if not part else _inner(folder, part)
        if given and folder is own:
            raise InputError(
                f"DRAKE_ISPACE_CACHE: others may write to {folder}, expected a folder of your own (chmod go-w)"
            )
    return None


def _inner(folder, part):
    """Return the folder `part` in a private one, made for this user alone; None if others may write to it."""
    folder = folder / part
    return folder if _writable(folder) and _private(folder) else None


def _writable(folder):
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    except OSError:
        return False
    return os.access(folder, os.W_OK | os.X_OK)


def _private(folder):
    """Return whether only this user can write to the folder, so that nobody else can plant machine code in it."""
    status = folder.lstat()
    return stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not status.st_mode & 0o022


@kernel
def copy(source, out):
    """Copy the first entries of `source` to `out`."""
    # A slice assignment would check for overlap every time.
    for i in range(out.shape[0]):
        out[i] = source[i]


def plain(compiled: Callable) -> Callable:
    """Return a kernel and its helper kernels as plain Python, which also accepts AutoDiffXd and Expression."""
    if not isinstance(compiled, Dispatcher):
        return compiled
    if stands_for := getattr(compiled, "stands_for", None):
        return stands_for
    function = compiled.py_func
    wanted = {"__builtins__", *_global_names(function.__code__)}
    names = {
        name: plain(value) if isinstance(value, Dispatcher) else value for name, value in function.__globals__.items()
        if name in wanted
    }
    return types.FunctionType(function.__code__, names, function.__name__, function.__defaults__)


@functools.cache
def arguments(function: Callable) -> tuple[str, ...]:
    """Return the names of a kernel's arguments without the last one, `out`."""
    return tuple(inspect.signature(getattr(function, "py_func", function)).parameters)[:-1]
