"""Damaged and hostile versions of a valid input, from a seeded stream of random numbers."""

import random

#: What has broken readers of text: numbers at the edge, words that other languages take for numbers, YAML's own signs.
TOKENS = [
    "nan", "inf", "-inf", ".nan", "1e999", "-1e999", "1e-400", "5e-324", "1.7976931348623157e308", "0x10", "0o17",
    "0777", "1_000", "1,5", "+.5", "5.", "-0", "١٢", "½", "9" * 4301, "9223372036854775808", "-1", "0", "1e3", "1E+3",
    "true", "yes", "off", "~", "null", "NULL", "''", '""', "'", '"', "\t", "\r", "\r\n", "\n\n", "\0", "\ufeff",
    "\x1b[31m", "\u202e", "é", "\x85", "\u2028", " ", "#", "# ", ":", ": ", "-", "- ", "? ", "|", ">", "{", "}", "[",
    "]", "{}", "[]", "&a ", "*a", "!!python/object:os.system ", "!!float ", "<<: ", "---\n", "...\n", "%YAML 1.1\n",
    "1:30", "2024-01-01", "../x", "/etc/passwd", "[" * 40, "{a: " * 40, "a" * 70000, ",", ";", "=", "(", ")", "@",
]
_BYTES = [b"\xff\xfe", b"\xef\xbb\xbf", b"\x00", b"\xff\xff\xff\xff", b"\x7f\xff\xff\xff", b"\x80", b"\xc3", b"PAR1"]


def damaged(seed_input: bytes, source: random.Random) -> bytes:
    """Bytes with one to four flips, cuts, copies or insertions."""
    data = bytearray(seed_input)
    for _ in range(source.choice((1, 1, 1, 2, 4))):
        at, length = source.randrange(len(data) + 1), source.choice((1, 2, 4, 16, 200))
        kind = source.randrange(7)
        if kind == 0 and data:
            data[at % len(data)] ^= 1 << source.randrange(8)
        elif kind == 1 and data:
            data[at % len(data)] = source.randrange(256)
        elif kind == 2:
            del data[at : at + length]
        elif kind == 3:
            data[at:at] = data[at : at + length]
        elif kind == 4:
            data[at:at] = source.choice(_BYTES)
        elif kind == 5:
            del data[at:]
        else:
            other = source.randrange(len(data) + 1)
            data[at : at + length] = data[other : other + length]
    return bytes(data)


def rewritten(seed_input: str, source: random.Random) -> str:
    """A text with one to four words, lines or signs changed."""
    text = seed_input
    for _ in range(source.choice((1, 1, 1, 2, 4))):
        kind = source.randrange(6)
        if kind == 0:
            text = _with_word(text, source)
        elif kind == 1:
            at = source.randrange(len(text) + 1)
            text = text[:at] + source.choice(TOKENS) + text[at:]
        elif kind == 2:
            lines = text.split("\n")
            i, j = source.randrange(len(lines)), source.randrange(len(lines))
            lines[i], lines[j] = lines[j], lines[i]
            text = "\n".join(lines)
        elif kind == 3:
            lines = text.split("\n")
            i = source.randrange(len(lines))
            lines[i : i + 1] = source.choice(([], [lines[i]] * 2, [" " + lines[i]], [lines[i].lstrip()]))
            text = "\n".join(lines)
        elif kind == 4:
            at = source.randrange(len(text) + 1)
            text = text[:at] + text[at + source.choice((1, 1, 2, 8)) :]
        else:
            at = source.randrange(len(text) + 1)
            text = text[:at] + chr(source.choice((source.randrange(32, 127), source.randrange(0x250)))) + text[at + 1 :]
    return text


def _with_word(text, source):
    """The text with one of its words or numbers replaced."""
    ends = [i for i, c in enumerate(text) if not (c.isalnum() or c in "._+-")]
    at = source.choice(ends) + 1 if ends else 0
    stop = at
    while stop < len(text) and (text[stop].isalnum() or text[stop] in "._+-"):
        stop += 1
    return text[:at] + source.choice(TOKENS) + text[stop:]
