"""Parsers that share nothing with those of the package: what a reader accepts must mean the same to them."""

import math
import re
import struct
import zlib

import numpy as np
import yaml


class Refused(Exception):
    """The input is not what it should be."""


_NUMBER = re.compile(r"\s*[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?\s*", re.ASCII)


def csv_table(data: bytes) -> tuple[tuple[str, ...], np.ndarray]:
    """Names and numbers (n, k) of a CSV file: a header, then as many numbers in every line; blank lines do not count.

    Cells are plain, or within quotes that hold no quote.
    """
    try:
        text = data.removeprefix(b"\xef\xbb\xbf").decode("utf-8")
    except UnicodeDecodeError:
        raise Refused("not UTF-8") from None
    head, *lines = text.split("\n")
    names = tuple(_cell(cell).strip() for cell in head.removesuffix("\r").split(","))
    rows = []
    for line in lines:
        line = line.removesuffix("\r")
        if not line.strip():
            continue
        cells = [_cell(cell) for cell in line.split(",")]
        if len(cells) != len(names) or not all(_NUMBER.fullmatch(cell) for cell in cells):
            raise Refused(f"a line that is not {len(names)} numbers: {line[:60]!r}")
        rows.append([float(cell) for cell in cells])
    if not rows or not np.isfinite(rows).all():
        raise Refused("no rows, or numbers that are not finite")
    return names, np.array(rows)


def _cell(text):
    if text.startswith('"') and text.endswith('"') and len(text) > 1:
        text = text[1:-1]
    if '"' in text:
        raise Refused("a quote")
    return text


def yaml_tree(text: str) -> dict:
    """The mapping in a YAML document by PyYAML's own parser, scalars after YAML 1.2."""
    text = text.removeprefix("\ufeff")
    try:
        try:
            root = yaml.compose(text, Loader=yaml.SafeLoader)
        except yaml.scanner.ScannerError:  # YAML lets tabs stand between words, PyYAML does not
            root = yaml.compose(re.sub(r"(?<=\S)[ \t]*\t[ \t]*", " ", text), Loader=yaml.SafeLoader)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise Refused(str(error)) from None
    if not isinstance(root, yaml.MappingNode):
        raise Refused("no mapping")
    return _value(root)


def _value(node):
    if isinstance(node, yaml.MappingNode):
        pairs = [(key.value, _value(inner)) for key, inner in node.value]
        if len({name for name, _ in pairs}) != len(pairs):
            raise Refused("a key twice")
        return dict(pairs)
    if isinstance(node, yaml.SequenceNode):
        return [_value(inner) for inner in node.value]
    if node.style is not None:
        return node.value
    return scalar(node.value)


def scalar(text: str):
    """A plain scalar after YAML 1.2, decimal numbers only."""
    if text in ("", "~", "null", "Null", "NULL"):
        return None
    if text in ("true", "True", "TRUE", "false", "False", "FALSE"):
        return text[0] in "tT"
    if re.fullmatch(r"[-+]?\d+", text, re.ASCII):
        return int(text) if len(text) < 4000 else math.inf
    if _NUMBER.fullmatch(text) and text == text.strip():
        return float(text)
    return text


def png_pixels(data: bytes) -> np.ndarray:
    """(rows, columns, 3) blue, green, red of a PNG of 8 bits a colour without interlace; every checksum is compared."""
    if data[:8] != b"\x89PNG\r\n\x1a\n":
        raise Refused("no PNG")
    at, packed, size = 8, b"", None
    while at < len(data):
        if len(data) < at + 12:
            raise Refused("cut off")
        (length,), kind = struct.unpack(">I", data[at : at + 4]), data[at + 4 : at + 8]
        body, check = data[at + 8 : at + 8 + length], data[at + 8 + length : at + 12 + length]
        if len(check) != 4 or struct.unpack(">I", check)[0] != zlib.crc32(kind + body):
            raise Refused("a checksum")
        if kind == b"IHDR":
            width, height, depth, colour, *rest = struct.unpack(">IIBBBBB", body)
            if (depth, colour, rest) != (8, 2, [0, 0, 0]):
                raise Refused("another kind of PNG")
            size = height, width
        elif kind == b"IDAT":
            packed += body
        elif kind == b"IEND":
            break
        at += 12 + length
    else:
        raise Refused("no end")
    if size is None:
        raise Refused("no size")
    try:
        raw = zlib.decompress(packed)
    except zlib.error:
        raise Refused("not packed") from None
    return _unfiltered(raw, *size)[:, :, ::-1]


def _unfiltered(raw, height, width):
    if len(raw) != height * (1 + 3 * width):
        raise Refused("too few pixels")
    rows, above = [], np.zeros(3 * width, int)
    for line in np.frombuffer(raw, np.uint8).reshape(height, -1).astype(int):
        kind, line = line[0], line[1:].copy()
        for i in range(3 * width):
            left, upper = (line[i - 3] if i > 2 else 0), above[i]
            corner = above[i - 3] if i > 2 else 0
            if kind == 4:
                guess = left + upper - corner
                near = [abs(guess - left), abs(guess - upper), abs(guess - corner)]
                line[i] += (left, upper, corner)[near.index(min(near))]
            elif kind in (1, 2, 3):
                line[i] += (left, upper, (left + upper) // 2)[kind - 1]
            elif kind:
                raise Refused("no such filter")
            line[i] %= 256
        rows.append(line)
        above = line
    return np.array(rows, np.uint8).reshape(height, width, 3)
