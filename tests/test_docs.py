"""What README and docs promise: code that runs, commands that exist, tests and files that are there."""

import re
import shlex
from pathlib import Path

import pytest

from drake_ispace.cli.app import app
from drake_ispace.scenario import scenario_names
from drake_ispace.wiring.catalog import CATALOG

HERE = Path(__file__).parent
ROOT = HERE.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
TEXT = {page.relative_to(ROOT).as_posix(): page.read_text(encoding="utf-8") for page in PAGES}
README = TEXT["README.md"]


def blocks(language):
    """(page, text) of every fenced block; `language`: only those of one."""
    pattern = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
    found = [(page, *match) for page, text in TEXT.items() for match in pattern.findall(text)]
    return [(page, text) for page, word, text in found if language in (None, word)]


PYTHON = blocks("python")
#: Of recordings on a page, what runs every time in their place; as they stand they take three times as long.
SHORTER = {"seconds=8.0": "seconds=3.0", "seconds=5.0": "seconds=2.0"}


def executed(page, text):
    """The names that there are after the code of a page."""
    names = {"__name__": "__main__"}
    exec(compile(text, page, "exec"), names)
    return names


COMMANDS = [
    (page, line.partition(" #")[0]) for page, text in blocks(None) for line in text.splitlines()
    if line.startswith("drake-ispace ")
]


@pytest.mark.parametrize("page, text", PYTHON, ids=[f"{page}-{i}" for i, (page, _) in enumerate(PYTHON)])
def test_code_on_a_page_runs(page, text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for long, short in SHORTER.items():
        text = text.replace(long, short)
    assert len(executed(page, text)) > 1


@pytest.mark.slow
@pytest.mark.parametrize("page, text", [(page, text) for page, text in PYTHON if any(long in text for long in SHORTER)])
def test_code_on_a_page_runs_with_recordings_as_long_as_there(page, text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert len(executed(page, text)) > 1


@pytest.mark.parametrize("page, line", COMMANDS, ids=[line for _, line in COMMANDS])
def test_a_command_on_a_page_is_understood(page, line):
    command, bound, _ = app.parse_args(shlex.split(line)[1:], exit_on_error=False, print_error=False)
    names = [bound.arguments.get("name"), *bound.arguments.get("names", ())]
    assert command.__name__.strip("_") == [word for word in line.split() if word != "scene"][1]
    known = (*scenario_names(), "cam.yaml", "run/scenario.yaml", "NAME")
    assert command.__name__ == "new" or all(name in known for name in names if name)


@pytest.mark.parametrize("name", CATALOG)
def test_the_readme_has_every_diagram(name):
    assert f"| `{name}` |" in README


@pytest.mark.parametrize("name", [name for name in app if not name.startswith("-")])
def test_the_readme_has_every_command(name):
    assert re.search(rf"^drake-ispace {name}\b", README, re.MULTILINE)


PACKAGE = ROOT / "src" / "drake_ispace"


def house():
    """Files and folders of the package in the order of the README."""
    lines = re.findall(r"^  (\S.*?)(?:  |$)", README.partition("## The house")[2], re.MULTILINE)
    return [re.split(r"[ /]", name)[0] for line in lines for name in line.split(", ")]


def test_the_readme_shows_the_whole_tree():
    there = {part.name for part in PACKAGE.iterdir() if not part.name.startswith("__") and part.name != "scenarios"}
    assert sorted(house()) == sorted(there)


def test_imports_run_downward():
    rank = {name.removesuffix(".py"): place for place, name in enumerate(house())}
    upward = [
        f"{file.relative_to(PACKAGE)}: {used}" for file in PACKAGE.rglob("*.py")
        for used in re.findall(r"^\s*from drake_ispace\.(\w+)", file.read_text(encoding="utf-8"), re.MULTILINE)
        if rank[used] > rank.get(file.relative_to(PACKAGE).parts[0].removesuffix(".py"), len(rank))
    ]
    assert upward == []


def named_tests():
    """(path below tests/, test or None) of everything that the ledger names, abbreviations resolved."""
    file, found = None, []
    for token in re.findall(r"`([^`\s]*test_[^`\s]*)`", TEXT["docs/fidelity.md"]):
        path, _, test = token.rpartition("::") if "::" in token else ("", "", token)
        if token.endswith(".py"):
            path, test = token, None
        if path:
            file = path
        found.append((file, test and test.removeprefix("…")))
    return found


@pytest.mark.parametrize("path, test", named_tests())
def test_a_test_in_the_ledger_exists(path, test):
    files = list(HERE.glob(f"**/{path.removeprefix('…')}")) if path.startswith("…") else [HERE / path]
    assert len(files) == 1 and files[0].is_file()
    if test is not None:
        name = re.escape(test.removesuffix("…")) + (r"\w*" if test.endswith("…") else "")
        assert re.search(rf"^def {name}\(", files[0].read_text(encoding="utf-8"), re.MULTILINE)


@pytest.mark.parametrize("page", TEXT)
def test_a_file_of_the_project_that_a_page_names_is_there(page):
    named = re.findall(r"(?<![\w/.])\w+/[\w/]*\w+\.(?:py|c|sh)\b", TEXT[page])
    below = (ROOT, PACKAGE, HERE, ROOT / "docs")
    assert [name for name in named if not any((folder / name).is_file() for folder in below)] == []


def test_the_targets_of_make_that_pages_name_are_in_the_makefile():
    lines = [line for _, text in blocks(None) for line in text.splitlines()]
    lines += [code for text in TEXT.values() for code in re.findall(r"`([^`\n]+)`", text)]
    named = {line.split()[1] for line in lines if line.startswith("make ")}
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert named and named <= set(re.findall(r"^([a-z-]+):", makefile, re.MULTILINE))


@pytest.mark.parametrize("page", TEXT)
def test_links_lead_somewhere(page):
    links = re.findall(r"\]\(([^)\s]+)\)", TEXT[page])
    local = [link.partition("#")[0] for link in links if not link.startswith(("http://", "https://", "#"))]
    assert [link for link in local if not ((ROOT / page).parent / link).exists()] == []
