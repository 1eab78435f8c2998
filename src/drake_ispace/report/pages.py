"""HTML pages from templates, written whole or not at all."""

from importlib import resources
from pathlib import Path

from drake_ispace.errors import InputError


def write_text(out: Path, text: str) -> None:
    """Write beside, then rename.

    Raises:
        InputError: the folder cannot be written.
    """
    beside = out.with_name(f".{out.name}.part")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        beside.write_text(text)
        beside.replace(out)
    except OSError as error:
        raise InputError(f"{out}: cannot be written ({error.strerror})") from None


def render(template: str, **values) -> str:
    """The package's template `template` with `values`, everything escaped."""
    import jinja2

    source = (resources.files("drake_ispace.report") / template).read_text()
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True)
    return environment.from_string(source).render(**values)
