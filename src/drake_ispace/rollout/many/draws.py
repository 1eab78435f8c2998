"""Random parameters of a campaign: distributions that are written `normal(7.3, 0.2)`, drawn by the number of the run.

A draw is a pure function of (seed, parameter, number of the run), as all noise is (noise.py): it does not depend on
the order of the runs, on the thread or machine, or on whether the campaign was interrupted.
"""

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from drake_ispace.blocks.errors import InputError, expected_one_of, shown
from drake_ispace.blocks.noise import normal_quantile, stream, uniform

_LARGEST = 1e9  # as in scenarios
_FORMS = {
    "normal": "normal(mean, std)", "uniform": "uniform(low, high)", "loguniform": "loguniform(low, high)",
    "choice": "choice(a, b, ...)",
}


@dataclass(frozen=True)
class Distribution:
    """`kind` of `_FORMS` with its numbers; made by `parse_distribution`, and `str()` gives its text back."""

    kind: str
    numbers: tuple[float, ...]

    def quantile(self, u: float) -> float:
        """The value below which a share `u` of the draws lies, 0 < u < 1; for a choice, of its list."""
        if self.kind == "choice":
            return self.numbers[int(u * len(self.numbers))]
        a, b = self.numbers
        if self.kind == "normal":
            return a + b * float(normal_quantile(u))
        if self.kind == "loguniform":
            return min(max(a * math.exp(u * math.log(b / a)), a), b)
        return a + (b - a) * u

    def draws(self, seed: int, key: str, runs: Iterable[int]) -> np.ndarray:
        """The values of the parameter `key` in the runs of these numbers >= 0."""
        source = stream(seed, f"vary/{key}")
        return np.array([self.quantile(uniform(source, run, 0)) for run in runs])

    def __str__(self) -> str:
        return f"{self.kind}({', '.join(map(repr, self.numbers))})"


def noise_seed(seed: int, run: int) -> int:
    """The seed of all noise in run number `run`: 52 bits of the stream "vary/" of `seed`, so that a single run can be
    repeated with `simulate --seed`."""
    return int(uniform(stream(seed, "vary/"), run, 0) * 2.0**52)


def parse_distribution(text: str, where: str) -> Distribution:
    """The distribution that `text` describes; `where` names it in messages.

    Raises:
        InputError: no such distribution, or numbers that it cannot have.
    """
    match = re.fullmatch(r"\s*(\w+)\s*\(([^()]*)\)\s*", text)
    if match is None:
        raise InputError(f"{where}: expected a distribution such as {' or '.join(_FORMS.values())}, got {shown(text)}")
    kind, inside = match[1], match[2]
    if kind not in _FORMS:
        raise InputError(f"{where}: there is no distribution {shown(kind)}, {expected_one_of(kind, _FORMS)}")
    numbers = tuple(_number(word, where) for word in inside.split(","))
    if kind != "choice" and len(numbers) != 2:
        raise InputError(f"{where}: expected two numbers, {_FORMS[kind]}, got {shown(text)}")
    low, high = numbers[0], numbers[-1]
    if kind == "normal" and high < 0.0:
        raise InputError(f"{where}: expected a standard deviation of at least 0, got {high:g}")
    if kind in ("uniform", "loguniform") and low > high:
        raise InputError(f"{where}: expected low <= high, got {low:g} and {high:g}")
    if kind == "loguniform" and low <= 0.0:
        raise InputError(f"{where}: expected bounds of more than 0, got {low:g}")
    return Distribution(kind, numbers)


def split_vary(texts: Sequence[str]) -> dict[str, str]:
    """key -> distribution from `key=distribution` words of the command line.

    Raises:
        InputError: a word without key or "=", a key that is named twice.
    """
    vary: dict[str, str] = {}
    for text in texts:
        key, equals, distribution = text.partition("=")
        key = key.strip()
        if not equals or not key or not text.isprintable():
            raise InputError(f"--vary {shown(text)}: expected key=distribution, as omni_plant.mass_kg=normal(7.3,0.2)")
        if key in vary:
            raise InputError(f"--vary {shown(key)}: is named twice, expected once")
        vary[key] = distribution
    return vary


def variable(names: Sequence[str]) -> list[str]:
    """The parameters of a rollout that a campaign may set: all but the keys of the random streams."""
    return [name for name in names if ".noise_stream[" not in name]


def find_parameter(key: str, names: Sequence[str], where: str) -> str:
    """The name among a rollout's parameters that `key` means; "omni.plant.mass_kg" is "omni_plant.mass_kg" too.

    Raises:
        InputError: there is none, or two.
    """
    names = variable(names)
    if key in names:
        return key
    same = [name for name in names if name.replace(".", "_") == key.replace(".", "_")]
    if len(same) == 1:
        return same[0]
    hint = expected_one_of(key.replace(".", "_", 1), names)
    if not hint.startswith("did you mean"):
        hint = "expected one that `drake-ispace montecarlo NAME --parameters` lists"
    raise InputError(f"{where}: there is no parameter {shown(key)}, {hint}")


def _number(word, where):
    try:
        value = float(word) if word.isascii() and "_" not in word else math.nan
    except ValueError:
        value = math.nan
    if not abs(value) <= _LARGEST:
        raise InputError(f"{where}: expected numbers between -{_LARGEST:g} and {_LARGEST:g}, got {shown(word.strip())}")
    return value
