"""Thousands of hostile inputs for every reader.

    python -m fuzz.campaign --inputs 20000 [--reader csv ...] [--seed 0]      (in the folder tests)

prints for each reader how many inputs it accepted and refused, and every input at which it raised anything else than an
InputError, took longer than 5 s, or read what does not stand there. The exit code is 1 if there is any.
"""

import argparse
import random
import signal
import sys
import tempfile
import traceback
from collections import Counter
from functools import partial
from pathlib import Path

from drake_ispace.blocks.errors import InputError
from fuzz.readers import READERS, Reader, Silent

LONGEST_S = 5.0


class Hang(BaseException):
    """A reader took too long."""


def outcome(reader: Reader, given) -> str:
    """What becomes of an input: "accepted", "refused", or what is wrong with the reader."""
    def stop(*_):
        raise Hang

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, LONGEST_S)
    try:
        reader.attack(given)
        return "accepted"
    except InputError as error:
        text = str(error)
        return "refused" if text.strip() and "\n" not in text else f"not one sentence: {text!r}"
    except Silent as error:
        return f"silent: {error}"
    except Hang:
        return f"longer than {LONGEST_S:g} s"
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        return f"{type(error).__name__}: {error} ({Path(place.filename).name}:{place.lineno})"
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def attack(name: str, inputs: int, seed: int, folder: Path, tell=lambda text: None) -> tuple[Counter, list]:
    """(how often each outcome was, inputs at which the reader failed with what happened) of a reader."""
    reader, source = READERS[name](folder), random.Random(f"{seed}/{name}")
    counts, failed = Counter(), []
    for number in range(inputs):
        given = reader.input(source)
        what = outcome(reader, given)
        counts[what if what in ("accepted", "refused") else "failed"] += 1
        if what not in ("accepted", "refused"):
            failed.append((given, what))
            tell(f"{name} {number}: {what[:200]}: {given[:160]!r}")
    return counts, failed


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--inputs", type=int, default=20_000, help="for each reader")
    parser.add_argument("--reader", nargs="+", choices=list(READERS), default=list(READERS))
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    bad = 0
    for name in options.reader:
        with tempfile.TemporaryDirectory() as folder:
            counts, failed = attack(name, options.inputs, options.seed, Path(folder), partial(print, flush=True))
        bad += len(failed)
        print(f"{name}: {counts['accepted']} accepted, {counts['refused']} refused, {len(failed)} failed", flush=True)
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main()
