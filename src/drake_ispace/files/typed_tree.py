"""Plain data, such as YAML gives, put over a tree of dataclasses: every key, type and range checked (quantity.py)."""

import copy
import dataclasses
import math
import sys
import typing

from drake_ispace.blocks.errors import InputError, expected_one_of, shown

_SMALLEST, _LARGEST = 1e-12, 1e9  # what a number other than 0 can be without computations overflowing


def read(defaults, data: dict, where: str):
    """A copy of the dataclass `defaults` with `data` put over it, every key and value checked.

    Raises:
        InputError: naming `where` and the dotted key.
    """
    result = copy.deepcopy(defaults)
    _merge(result, data, where, "")
    return result


def _merge(target, data, where, path):
    if data is None:  # a section in which everything is commented out
        return
    fields = {f.name: f for f in dataclasses.fields(target)}
    if not isinstance(data, dict):
        keys = ", ".join(list(fields)[:3])
        raise InputError(f"{where}: {path}: expected a mapping with keys such as {keys}, got {shown(data)}")
    for key, value in data.items():
        dotted = f"{path}.{key}" if path else key
        if key not in fields:
            raise InputError(f"{where}: {dotted}: unknown key, {expected_one_of(key, fields)}")
        if dataclasses.is_dataclass(getattr(target, key)):
            _merge(getattr(target, key), value, where, dotted)
        elif fields[key].type is dict:
            setattr(target, key, _merged_mapping(getattr(target, key), value, f"{where}: {dotted}"))
        else:
            setattr(target, key, checked(value, fields[key].type, fields[key].metadata, f"{where}: {dotted}"))


def _merged_mapping(known, value, where):
    """A free mapping of mappings with `value` put over it; what it may hold is for its owner to check."""
    if not isinstance(value, dict):
        raise InputError(f"{where}: expected a mapping of names, got {shown(value)}")
    merged = dict(known)
    for name, inner in value.items():
        if not isinstance(name, str) or not isinstance(inner, dict | None):
            raise InputError(f"{where}.{name}: expected a mapping of numbers, got {shown(inner)}")
        merged[name] = {**merged.get(name, {}), **(inner or {})}
    return merged


def checked(value, kind, rules, where):
    """`value` as `kind`, within the `rules` of `quantity`.

    Raises:
        InputError: the sentence begins with `where`.
    """
    options = [option for option in typing.get_args(kind) if option is not type(None)]
    if type(None) in typing.get_args(kind):
        if value is None:
            return None
        kind = options[0]
    if typing.get_origin(kind) is list:
        (inner,) = typing.get_args(kind)
        length = rules.get("length")
        if not isinstance(value, list) or (length is not None and len(value) != length):
            raise InputError(f"{where}: expected a list of {f'{length} ' if length else ''}values, got {shown(value)}")
        return [checked(entry, inner, {**rules, "length": None}, f"{where}[{i}]") for i, entry in enumerate(value)]
    unit = f" [{rules['unit']}]" if rules.get("unit") else ""
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if type(value) is not kind:
        names = {float: "a number", int: "a whole number", bool: "true or false", str: "a word"}
        hint = f" without a unit, in {rules['unit']}" if kind is float and isinstance(value, str) and unit else unit
        raise InputError(f"{where}: expected {names[kind]}{hint}, got {shown(value)}")
    if kind is float and not math.isfinite(value):
        raise InputError(f"{where}: expected a finite number{unit}, got {value}")
    tests = {
        "minimum": (lambda limit: value >= limit, "at least"), "maximum": (lambda limit: value <= limit, "at most"),
        "above": (lambda limit: value > limit, "more than"), "below": (lambda limit: value < limit, "less than"),
    }
    for rule, (holds, words) in tests.items():
        if rules.get(rule) is not None and not holds(rules[rule]):
            raise InputError(f"{where}: expected {words} {rules[rule]:g}{unit}, got {value:g}")
    if kind is float and abs(value) < sys.float_info.epsilon and rules.get("above") is None:
        return 0.0  # what rounding leaves, as of cos(90 degrees)
    if kind is float and value and not _SMALLEST <= abs(value) <= _LARGEST:
        raise InputError(f"{where}: expected a size between {_SMALLEST:g} and {_LARGEST:g}{unit}, got {value:g}")
    if rules.get("choices") and value not in rules["choices"]:
        raise InputError(f"{where}: {shown(value)} is not known, expected one of {', '.join(rules['choices'])}")
    return value


def difference(data: dict, defaults: dict) -> dict:
    """What of the plain mappings `data` differs from `defaults`."""
    changed = {}
    for key, value in data.items():
        if isinstance(value, dict):
            if inner := difference(value, defaults.get(key, {})):
                changed[key] = inner
        elif key not in defaults or value != defaults[key]:
            changed[key] = value
    return changed
