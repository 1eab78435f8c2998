"""What every reader under attack shares: hostile inputs, and the comparison of what was read with what stands there."""

import random
from collections.abc import Callable
from pathlib import Path

from fuzz import strict
from fuzz.mutate import rewritten


class Silent(Exception):
    """A reader accepted what is not so."""


class Reader:
    """What is attacked.

    Args:
        folder: for files, empty.
    """

    def __init__(self, folder: Path):
        self.folder = folder

    def input(self, source: random.Random) -> bytes | str:
        """A hostile input."""
        raise NotImplementedError

    def attack(self, given: bytes | str) -> None:
        """Read it.

        Raises:
            InputError: it is refused. Silent: what was read is not what stands there.
        """
        raise NotImplementedError


def same(found, wanted) -> bool:
    """Whether a number, word or tree is the one that stands there."""
    if isinstance(wanted, dict):
        return all(same(_part(found, key), value) for key, value in wanted.items())
    if isinstance(wanted, list):
        return len(found) == len(wanted) and all(map(same, found, wanted))
    if isinstance(wanted, int | float) and not isinstance(wanted, bool):
        return not isinstance(found, bool | str) and found == wanted
    if isinstance(wanted, str):  # the strict parser may have made spaces of tabs
        return isinstance(found, str) and found.split() == wanted.split()
    return type(found) is type(wanted) and found == wanted


def _part(found, key):
    return found[key] if isinstance(found, dict) else getattr(found, key)


def strictly(parse: Callable, given):
    """What a strict parser makes of an input that a reader accepted.

    Raises:
        Silent: it refuses it.
    """
    try:
        return parse(given)
    except strict.Refused as refused:
        raise Silent(f"a strict parser refuses it: {refused}") from None


def written(path: Path, text: str) -> Path:
    """The file, with every letter of a hostile text in it as it is."""
    path.write_text(text, encoding="utf-8", errors="surrogatepass", newline="")
    return path


def agree(found, text: str, tree=None) -> None:
    """Raise Silent unless every leaf of a YAML text is found; sections without content count as left out."""
    wanted = strictly(strict.yaml_tree, text) if tree is None else tree
    try:
        if not same(found, _filled(wanted)):
            raise Silent("a value is another")
    except (KeyError, AttributeError, TypeError) as error:
        raise Silent(f"a key is missing: {error}") from None


def _filled(tree):
    return {
        key: _filled(value) if isinstance(value, dict) else value for key, value in tree.items() if value is not None
    }


class YamlFile(Reader):
    """A file of YAML that describes one thing.

    Attributes:
        SEEDS: valid texts. load: what reads the file of a name.
    """

    SEEDS: tuple[str, ...]
    load: Callable[[str], object]

    def input(self, source):
        return rewritten(source.choice(self.SEEDS), source)

    def attack(self, given):
        agree(self.load(str(written(self.folder / "hostile.yaml", given))), given)
