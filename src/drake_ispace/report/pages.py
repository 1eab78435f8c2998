"""HTML pages from templates, written whole or not at all."""

from importlib import resources
from pathlib import Path

from drake_ispace.files.places import whole_file


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
