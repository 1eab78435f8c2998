"""Places on disk that a command is about to write: looked at before the work, written whole or not at all.

What is being made lies beside its place under a hidden name that tells which process makes it. A process that was
killed leaves it there; whoever writes to the same place next clears it away, and puts back what was about to be
replaced.
"""

import ctypes
import os
import shutil
import socket
import sys
import uuid
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from drake_ispace.blocks.errors import InputError

CONTENTS = ".contents"  # of a folder that `fresh_folder` made: the names of what it wrote there, a line each
_NEW, _OLD = ".new", ".old"
_EXCHANGE = 2  # RENAME_EXCHANGE of Linux, RENAME_SWAP of macOS
_AT_FDCWD = -100


def check_folder(folder: Path) -> None:
    """Make sure that `folder` exists or can be made, and can be written into; nothing is left behind.

    Raises:
        InputError: a file is in the way, or the folder cannot be written.
    """
    nearest = Path(os.path.realpath(folder))
    name = nearest.name
    while not os.path.lexists(nearest) and nearest != nearest.parent:
        nearest = nearest.parent
    clear_leftovers(nearest / name)
    trial = beside(nearest / name)  # permissions alone do not tell: /proc lets root in, not files
    try:
        trial.mkdir()
    except OSError as error:
        raise InputError(
            f"{folder}: cannot be written ({error.strerror}), expected a folder that exists or can be made"
        ) from None
    finally:  # Ctrl-C leaves nothing behind either
        with suppress(OSError):
            trial.rmdir()


@contextmanager
def whole_file(out: Path) -> Iterator[Path]:
    """A path beside `out` to write to: renamed to `out` at the end, deleted where something goes wrong.

    Raises:
        InputError: the file or its folder cannot be written.
    """
    fresh = beside(out).with_suffix(f"{_NEW}{out.suffix}")  # the suffix tells some libraries what to write
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        clear_leftovers(out)
        yield fresh
        fresh.replace(out)
    except OSError as error:
        raise InputError(f"{out}: cannot be written ({error.strerror or error})") from None
    finally:
        with suppress(OSError):
            fresh.unlink()


def check_own_folder(folder: Path, what: str) -> None:
    """Make sure that `folder` is new, empty, or one that `fresh_folder` made before, with nothing of the user's in it.

    Raises:
        InputError: it holds something else than `what`, is a file, or cannot be written.
    """
    check_folder(folder)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file, expected a new or an empty folder")
    found = {entry.name for entry in folder.iterdir()} if folder.is_dir() else set()
    if found and CONTENTS not in found:
        raise InputError(f"{folder}: holds something else than {what}, expected a new or an empty folder")
    known = (folder / CONTENTS).read_text(encoding="utf-8").splitlines() if found else []
    if other := sorted(found - {CONTENTS, *known}):
        raise InputError(f"{folder / other[0]}: is no part of {what} to replace, expected it moved elsewhere first")


@contextmanager
def fresh_folder(out: Path, what: str = "what is written there") -> Iterator[Path]:
    """A new folder to write into, which takes the place of `out` as a whole at the end and is deleted where something
    goes wrong: `out` never holds parts of two runs.

    Raises:
        InputError: the folder cannot be written, or holds something else than `what` was written there before.
    """
    out = Path(os.path.realpath(out))
    clear_leftovers(out)
    check_own_folder(out, what)
    fresh = beside(out)
    try:
        fresh.mkdir(parents=True)
        yield fresh
        names = sorted(entry.name for entry in fresh.iterdir())
        (fresh / CONTENTS).write_text("".join(f"{name}\n" for name in names), encoding="utf-8")
        put_in_place(fresh, out)
    except OSError as error:
        raise InputError(f"{out}: cannot be written ({error.strerror or error})") from None
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


def beside(out: Path) -> Path:
    """A hidden path beside `out` that belongs to this process."""
    return out.with_name(f".{out.name}.{_machine()}.{os.getpid()}.{uuid.uuid4().hex}{_NEW}")


def put_in_place(fresh: Path, out: Path) -> None:
    """Give the folder `fresh` the name `out`; what was there is deleted. `out` is whole at every moment.

    Where the file system cannot exchange two names, what was there steps aside first: `clear_leftovers` puts it back.
    """
    if not os.path.lexists(out):
        fresh.rename(out)
        return
    if _exchanged(fresh, out):
        shutil.rmtree(fresh, ignore_errors=True)
        return
    old = fresh.with_suffix(_OLD)
    out.rename(old)
    try:
        fresh.rename(out)
    except BaseException:
        old.rename(out)
        raise
    shutil.rmtree(old, ignore_errors=True)


def clear_leftovers(out: Path) -> None:
    """Delete what processes that were killed left beside `out`; what they were replacing is put back if it is gone."""
    with suppress(OSError):
        for entry in list(out.parent.iterdir()):
            if not entry.name.startswith(f".{out.name}.") or not _is_dead(entry.name[len(out.name) + 2 :]):
                continue
            with suppress(OSError):
                if entry.suffix == _OLD and not os.path.lexists(out):
                    entry.rename(out)
                elif entry.is_dir() and not entry.is_symlink():
                    shutil.rmtree(entry)
                else:
                    entry.unlink()


def _is_dead(rest: str) -> bool:
    """Whether a name made by `beside`, without its beginning, is of a process of this machine that is no more."""
    machine, _, rest = rest.partition(".")
    number, _, rest = rest.partition(".")
    if machine != _machine() or not (number.isascii() and number.isdigit()) or not 0 < int(number) < 2**31:
        return False
    if not any(mark in rest for mark in (_NEW, _OLD)):
        return False
    try:
        os.kill(int(number), 0)
    except OSError as error:
        return isinstance(error, ProcessLookupError)
    return False


def _machine() -> str:
    """A short name of this machine, for a folder that several share."""
    return f"{zlib.crc32(socket.gethostname().encode()):08x}"


def _exchanged(one: Path, other: Path) -> bool:
    """Exchange the names of two files or folders in one step; False where the system cannot."""
    libc = ctypes.CDLL(None, use_errno=True)
    paths = os.fsencode(one), os.fsencode(other)
    if sys.platform == "darwin" and hasattr(libc, "renamex_np"):
        return libc.renamex_np(*paths, _EXCHANGE) == 0
    if hasattr(libc, "renameat2"):
        return libc.renameat2(_AT_FDCWD, paths[0], _AT_FDCWD, paths[1], _EXCHANGE) == 0
    return False
