"""Reads YAML that a user wrote: nothing ambiguous gets through, nothing hostile costs time.

The document is built here from the parser's events, so that every refusal knows its line and dotted key, and so that
nesting and aliases are refused before they cost anything. Scalars follow YAML 1.2: `1e-3` is a number (PyYAML alone,
which follows 1.1, makes it a string), and `on`, `off`, `yes`, `no`, `1:30` and `2024-01-01` are strings. Keys are
always strings.
"""

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from drake_ispace.blocks.errors import InputError, shown

LARGEST_FILE = 1 << 18  # bytes; at the worst a second of parsing
DEEPEST_NESTING = 32
LARGEST_INTEGER = 2**62
_BYTE_ORDER_MARK = "\ufeff"
_TOO_DEEP = f"nested more than {DEEPEST_NESTING} deep"

_NULL = re.compile(r"(?:~|null|Null|NULL|)\Z")
_BOOL = re.compile(r"(?:true|True|TRUE|false|False|FALSE)\Z")
_INTEGER = re.compile(r"([-+]?)0*([0-9]+)\Z")  # sign, and digits without leading zeros
_NUMBER = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?\Z")
_NOT_FINITE = re.compile(r"[-+]?\.?(?:inf|infinity|nan)\Z", re.IGNORECASE)


def load_yaml(text_or_path: str | Path, where: str) -> dict[str, Any]:
    """The mapping at the root of a YAML document, as plain dicts, lists, strings, bools, ints, finite floats and None.

    Parameters
    ----------
    text_or_path
        A `Path` is read from disk (UTF-8, with or without a byte order mark); a `str` is the document itself.
    where
        What messages call the document, usually the path of its file.

    Raises
    ------
    InputError
        Naming `where`, the line and the dotted key: not YAML, empty, root not a mapping, duplicate key, anchor, alias,
        merge key, tag, NaN or infinity, number out of range, deeper than `DEEPEST_NESTING`, larger than `LARGEST_FILE`.
    """
    import yaml

    text = _read(text_or_path, where) if isinstance(text_or_path, Path) else text_or_path
    if len(text) > LARGEST_FILE:
        raise InputError(f"{where}: larger than {LARGEST_FILE} bytes, expected a YAML file of a few kilobytes")
    text = text.removeprefix(_BYTE_ORDER_MARK)
    if _BYTE_ORDER_MARK in text:  # libyaml would read over it, other parsers refuse it
        line = text.count("\n", 0, text.index(_BYTE_ORDER_MARK)) + 1
        raise InputError(f"{where}: line {line}: holds a byte order mark, expected one at the start of the file only")
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # libyaml, where PyYAML was built with it
    try:
        return _Builder(yaml.parse(text, Loader=loader), where).document()
    except (yaml.YAMLError, UnicodeError) as error:
        mark = getattr(error, "problem_mark", None)
        place = f"{where}: line {mark.line + 1}" if mark else where
        problem = getattr(error, "problem", None) or getattr(error, "reason", None) or "cannot be parsed"
        if "nesting depth" in problem:  # libyaml reads ahead, and has a limit of its own, beyond ours
            raise InputError(f"{place}: {_TOO_DEEP}") from None
        raise InputError(f"{place}: expected valid YAML, but {problem}") from None


def dump_yaml(data: dict[str, Any]) -> str:
    """`data` as a YAML text from which `load_yaml` reads the same values, keys in the order given."""
    import yaml

    class Dumper(yaml.SafeDumper):
        def ignore_aliases(self, data: object) -> bool:
            return True  # an object used twice is written twice, as load_yaml refuses aliases

    # What YAML 1.2 takes for a number and YAML 1.1 for a string must be quoted when it is a string.
    for pattern in (_NUMBER, _NOT_FINITE):
        Dumper.add_implicit_resolver("tag:yaml.org,2002:float", pattern, None)
    return yaml.dump(data, Dumper=Dumper, sort_keys=False, allow_unicode=True, width=120)


def _read(path: Path, where: str) -> str:
    try:
        if not path.is_file():
            found = "there is a folder" if path.is_dir() else "there is none"
            raise InputError(f"{where}: expected a file, {found}")
        with open(path, "rb") as file:
            data = file.read(LARGEST_FILE + 1)
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(f"{where}: line {line}: expected UTF-8 text, found byte 0x{data[error.start]:02x}") from None
    except OSError as error:
        raise InputError(f"{where}: cannot be read ({error.strerror})") from None


class _Builder:
    """Turns the parser's events into plain Python values; `key` is the dotted key of the node at hand."""

    def __init__(self, events: Iterator[Any], where: str):
        self.events = events
        self.where = where

    def document(self) -> dict[str, Any]:
        import yaml

        event = next(self.events)
        while isinstance(event, (yaml.StreamStartEvent, yaml.DocumentStartEvent)):
            event = next(self.events)
        if isinstance(event, yaml.StreamEndEvent):
            raise InputError(f"{self.where}: empty, expected 'key: value' lines")
        if not isinstance(event, yaml.MappingStartEvent):
            raise self.refusal(event, "", "expected 'key: value' lines at the top level")
        root = self.node(event, "", 1)
        next(self.events)  # the end of this document
        event = next(self.events)
        if not isinstance(event, yaml.StreamEndEvent):
            raise self.refusal(event, "", "a second YAML document begins, expected only one")
        return root

    def node(self, event: Any, key: str, depth: int) -> Any:
        import yaml

        if isinstance(event, yaml.AliasEvent) or event.anchor is not None:
            raise self.refusal(event, key, f"anchor or alias {shown(event.anchor)}, expected the value written out")
        if event.tag is not None:
            raise self.refusal(event, key, f"tag {shown(event.tag)}, expected a value without a tag")
        if isinstance(event, yaml.ScalarEvent):
            is_plain, _ = event.implicit  # neither quoted nor a block
            return self.scalar(event, key) if is_plain else event.value
        if depth > DEEPEST_NESTING:
            raise InputError(f"{self.where}: line {event.start_mark.line + 1}: {_TOO_DEEP}")
        if isinstance(event, yaml.SequenceStartEvent):
            values: list[Any] = []
            while not isinstance(event := next(self.events), yaml.SequenceEndEvent):
                values.append(self.node(event, f"{key}[{len(values)}]", depth + 1))
            return values
        return self.mapping(key, depth)

    def mapping(self, key: str, depth: int) -> dict[str, Any]:
        import yaml

        values: dict[str, Any] = {}
        lines: dict[str, int] = {}
        while not isinstance(event := next(self.events), yaml.MappingEndEvent):
            if not isinstance(event, yaml.ScalarEvent) or event.anchor or event.tag or event.value in ("", "<<"):
                raise self.refusal(event, key, "expected a plain word as key")
            name = event.value
            inner = f"{key}.{name}" if key else name
            if name in values:
                raise self.refusal(event, inner, f"written twice (first on line {lines[name]}), expected once")
            lines[name] = event.start_mark.line + 1
            values[name] = self.node(next(self.events), inner, depth + 1)
        return values

    def scalar(self, event: Any, key: str) -> str | bool | int | float | None:
        text = event.value
        if _NULL.match(text):
            return None
        if _BOOL.match(text):
            return text.lower() == "true"
        if _NOT_FINITE.match(text):
            raise self.refusal(event, key, f"{shown(text)}, expected a finite number")
        if not _NUMBER.match(text):
            return text
        is_integer, number = _INTEGER.match(text), float(text)
        if abs(number) > LARGEST_INTEGER if is_integer else math.isinf(number):
            raise self.refusal(event, key, f"{shown(text)} is out of range, expected a number that fits 64 bits")
        return int("".join(is_integer.groups())) if is_integer else number

    def refusal(self, event: Any, key: str, problem: str) -> InputError:
        readable = key if key.isprintable() and len(key) <= 200 else shown(key)
        place = f"{self.where}: line {event.start_mark.line + 1}"
        return InputError(f"{place}: {readable}: {problem}" if key else f"{place}: {problem}")
