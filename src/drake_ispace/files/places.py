"""Places on disk that a command is about to write: looked at before the work, written whole or not at all."""

import os
import shutil
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from drake_ispace.blocks.errors import InputError


def check_folder(folder: Path) -> None:
    """Make sure that `folder` exists or can be made, and can be written into; nothing is left behind.

    Raises:
        InputError: a file is in the way, or the folder cannot be written.
    """
    nearest = Path(os.path.realpath(folder))
    name = nearest.name
    while not os.path.lexists(nearest) and nearest != nearest.parent:
        nearest = nearest.parent
    trial = nearest / f".{name}.{uuid.uuid4().hex}.new"  # permissions alone do not tell: /proc lets root in, not files
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
    beside = out.with_name(f".{uuid.uuid4().hex}.{out.name}")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        yield beside
        beside.replace(out)
    except OSError as error:
        raise InputError(f"{out}: cannot be written ({error.strerror or error})") from None
    finally:
        with suppress(OSError):
            beside.unlink()


def check_own_folder(folder: Path, mark: str, what: str) -> None:
    """Make sure that `folder` is new, empty, or one that `fresh_folder` made before: then the file `mark` lies in it.

    Raises:
        InputError: it holds something else than `what`, is a file, or cannot be written.
    """
    check_folder(folder)
    if folder.is_dir() and any(folder.iterdir()) and not (folder / mark).is_file():
        raise InputError(f"{folder}: holds something else than {what}, expected a new or an empty folder")
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file, expected a new or an empty folder")


@contextmanager
def fresh_folder(out: Path) -> Iterator[Path]:
    """A new folder beside `out` to write into: what is in it is moved to `out` at the end, deleted where something goes
    wrong, so that `out` never holds parts of two runs.

    Raises:
        InputError: the folder cannot be written.
    """
    out = Path(os.path.realpath(out))
    fresh = out.with_name(f".{out.name}.{uuid.uuid4().hex}.new")
    try:
        fresh.mkdir(parents=True)
        yield fresh
        out.mkdir(parents=True, exist_ok=True)
        for part in sorted(fresh.iterdir()):
            part.replace(out / part.name)
    except OSError as error:
        raise InputError(f"{out}: cannot be written ({error.strerror or error})") from None
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
