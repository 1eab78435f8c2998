"""HTML pages from templates, written whole or not at all."""

import base64
from importlib import resources
from pathlib import Path

from drake_ispace.blocks.errors import InputError
from drake_ispace.files.places import whole_file

_MIME = {".png": "image/png", ".svg": "image/svg+xml"}


def write_text(out: Path, text: str) -> None:
    """Write a text file whole or not at all.

    Raises:
        InputError: the folder cannot be written.
    """
    with whole_file(out) as beside:
        beside.write_text(text, encoding="utf-8")


def render(template: str, **values) -> str:
    """Fill the package's template `template` with `values`, all of them escaped."""
    import jinja2

    source = (resources.files("drake_ispace.report") / template).read_text(encoding="utf-8")
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True)
    return environment.from_string(source).render(**values)


def embedded(file: Path) -> str:
    """A picture as a data: address, so that the page needs no other file.

    Raises:
        InputError: the picture cannot be read.
    """
    try:
        data = base64.b64encode(file.read_bytes()).decode()
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror})") from None
    return f"data:{_MIME[file.suffix]};base64,{data}"
