"""Pictures of Diagrams: Drake's own Graphviz text, made readable, and drawn by the Graphviz inside pygraphviz.

Blocks are titled by name, with their class and the period of their updates below, and tinted by where they live. The
outputs that a Diagram exports for logging are left out, for they would cross every other wire.
"""

import html
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Collection
from pathlib import Path

from pydrake.systems.framework import Diagram, System

from drake_ispace.blocks.errors import InputError, shown
from drake_ispace.files.places import whole_file
from drake_ispace.report.pictures.schedule import schedule
from drake_ispace.scenario import Scenario
from drake_ispace.wiring.catalog import build_diagram

SUFFIXES = (".dot", ".svg", ".png")

#: Where a block lives -> tint of its title, colour of the wires that leave it.
COLOURS = {
    "plant": ("#dcead5", "#5a8a49"), "sensing": ("#fdeec5", "#b98a14"), "control": ("#d9e6f5", "#3f70ad"),
    "room": ("#ecdff2", "#8754a6"), "effect": ("#fbe3d0", "#c06a30"), "new": ("#ff9d5c", "#e0661a"),
    "other": ("#eeeeee", "#666666"),
}
#: Package of a block's class -> where it lives.
_HOMES = {
    "plants": "plant", "sensing": "sensing", "control": "control", "room": "room", "vision": "room",
    "effects": "effect",
}
#: Blocks of `control` that run in the room, at its rate.
_ROOM_CONTROL = {"WayPoint", "TrajectoryTracker"}

_STYLE = """\
rankdir=LR
ranksep=0.55
nodesep=0.3
fontname="DejaVu Sans,Verdana,sans-serif"
fontsize=13
node [fontname="DejaVu Sans,Verdana,sans-serif", fontsize=11]
edge [arrowsize=0.6, penwidth=1.2]
"""
_DRAW = """\
import sys
import pygraphviz
graph = pygraphviz.AGraph(string=sys.stdin.read())
sys.stdout.buffer.write(graph.draw(format=sys.argv[1], prog="dot"))
"""
_DRAW_LIMIT_S = 120.0

_TITLE = re.compile(r"<B>(?P<type>[^\n]*?)</B>(?:<BR/>\nname=(?P<name>[^\n]*))?")
_BOX = re.compile(r'^s(?P<id>\d+) \[[^\n]*\n<TABLE [^\n]*\n<TR><TD (?P<cell>[^>\n]*)>\n' + _TITLE.pattern, re.M)
_WIRE = re.compile(r"^s(?P<source>\d+):(?P<out>\w+):e -> s(?P<target>\d+):(?P<in>\w+):w$", re.M)
_WIRES = re.compile(r"(?:^s\d+\w*:\S+ -> [^\n]*\n)+", re.M)
#: Drake's loud colours of exported ports and their wires.
_LOUD = re.compile(r'(?<=<TABLE BORDER="0" COLOR=)"(?:blue|green)"|(?<=\[color=)(?:blue|green)(?=\];$)', re.M)
_FRAME = "color=black\nconcentrate=true\n"
_STRUCTURE = re.compile(r"(?:digraph|subgraph) |s\d+(?:in|out)? \[|s\d+(?:in|out)?:\S+ -> |s\d+$")
_NUMBER = re.compile(r"(?<![:\w])(?P<kind>s|clusters?|(?<=digraph )_)(?P<id>\d+)(?P<part>[a-z]*)")


def dot_text(diagram: System, depth: int | None = None, highlight: Collection[str] = ()) -> str:
    """`diagram` as Graphviz text; the same text for the same Diagram, whenever and wherever it is built.

    Args:
        diagram: any Drake Diagram, or a single System.
        depth: how many levels of nested Diagrams are opened; None opens all.
        highlight: names of blocks drawn in a signal colour.
    """
    text = diagram.GetGraphvizString(max_depth=depth)
    top = re.match(r"digraph _(\d+)", text)[1]
    text = _WIRES.sub(_sorted_wires, _without_exports(text, top))
    boxes = {box["id"]: box for box in _BOX.finditer(text)}
    homes = {number: _home(box["type"]) for number, box in boxes.items()}
    new = {number for number, box in boxes.items() if _name(box) in highlight}
    looks = {number: "new" if number in new else home for number, home in homes.items()}
    periods = _periods(diagram)
    text = _BOX.sub(lambda box: _tinted(box, COLOURS[looks[box["id"]]][0]), text)
    text = _TITLE.sub(lambda title: _titled(title, periods), text)
    if isinstance(diagram, Diagram):
        children = {child.get_name() for child in diagram.GetSystems()}
        inside = [number for number, box in boxes.items() if _name(box) in children]
        opening = f'subgraph cluster{top}subsystems {{\ncolor=white\nlabel=""\n'
        text = text.replace(opening, opening + _room(text, inside, homes))
    text = _WIRE.sub(lambda wire: _drawn(wire, homes, looks), text)
    text = _LOUD.sub('"#888888"', text).replace("color=lightgrey\nstyle=filled\n", 'color="#eeeeee"\nstyle=filled\n')
    text = text.replace("rankdir=LR\n", _STYLE + _legend(set(looks.values())), 1)
    text = text.replace(_FRAME, "color=white\n", 1).replace(_FRAME, 'color="#aaaaaa"\nstyle=rounded\n')
    return _named(text, boxes)


def draw(
    diagram: System | Scenario | str | Path, out: str | Path, depth: int | None = None, highlight: Collection[str] = ()
) -> None:
    """Draw a Diagram, or that of a scenario, its name or its file, into a file.

    Args:
        diagram: what to draw. out: the file; its suffix .dot, .svg or .png says what is written.
        depth, highlight: as `dot_text`.

    Raises:
        InputError: as `build_diagram`, another suffix, no pygraphviz, Graphviz failed, or a place that cannot be
            written.
    """
    out = Path(out)
    if out.suffix not in SUFFIXES:
        raise InputError(f"{out}: a picture is .dot, .svg or .png, not {shown(out.suffix)}")
    system = diagram if isinstance(diagram, System) else build_diagram(diagram)
    picture = dot_text(system, depth, highlight).encode()
    if out.suffix != ".dot":
        picture = _rendered(picture, out)
    with whole_file(out) as beside:
        beside.write_bytes(picture)


def _rendered(text: bytes, out: Path) -> bytes:
    """The picture of Graphviz `text` in the format of `out`, drawn by a child, for Graphviz can crash a process."""
    advice = f"draw {out.with_suffix('.dot').name} instead"
    command = [sys.executable, "-c", _DRAW, out.suffix[1:]]
    try:
        child = subprocess.run(command, input=text, capture_output=True, timeout=_DRAW_LIMIT_S)
    except subprocess.TimeoutExpired:
        raise InputError(f"{out}: Graphviz took longer than {_DRAW_LIMIT_S:g} s, {advice}") from None
    complaint = child.stderr.decode(errors="replace").strip().splitlines()
    if child.returncode != 0 and any("ImportError" in line or "ModuleNotFoundError" in line for line in complaint):
        raise InputError(f"{out}: needs pygraphviz ({complaint[-1]}): pip install pygraphviz, or {advice}")
    if child.returncode != 0 or not child.stdout:
        reason = complaint[-1] if complaint else f"exit status {child.returncode}"
        raise InputError(f"{out}: Graphviz could not draw it ({reason}), {advice}")
    if out.suffix == ".svg":  # a comment names the release of Graphviz
        return re.sub(rb"<!--.*?-->\n?", b"", child.stdout, flags=re.S)
    return child.stdout


def _without_exports(text, top):
    """Drop the outputs of the outermost Diagram and the wires to them."""
    text = re.sub(rf"^subgraph clusters{top}out \{{\n.*?^\}}\n", "", text, count=1, flags=re.M | re.S)
    return re.sub(rf"^\S+ -> s{top}out:[^\n]*\n", "", text, flags=re.M)


def _sorted_wires(wires):
    """Sort wires by the order in which blocks were made: Drake sorts them by address, which differs every time."""
    return "".join(sorted(wires[0].splitlines(True), key=lambda wire: (list(map(int, re.findall(r"\d+", wire))), wire)))


def _name(box):
    return None if box["name"] is None else html.unescape(box["name"])


def _home(type_name):
    package, _, inner = type_name.partition(".")
    if package != "drake_ispace":
        return "other"
    return "room" if inner.rpartition(".")[2] in _ROOM_CONTROL else _HOMES.get(inner.partition(".")[0], "other")


def _tinted(box, tint):
    return box[0].replace(f"<TD {box['cell']}>", f'<TD {box["cell"]} BGCOLOR="{tint}" CELLPADDING="5">', 1)


def _drawn(wire, homes, looks):
    source, target = f"s{wire['source']}:{wire['out']}", f"s{wire['target']}:{wire['in']}"
    colour = COLOURS[looks.get(wire["source"], "other")][1]
    # The wire that closes the loop, from control back to the plant, runs from right to left below the others.
    if homes.get(wire["source"]) == "control" and homes.get(wire["target"]) in ("plant", "effect"):
        return f'{target} -> {source} [dir=back, color="{colour}"]'
    return f'{source}:e -> {target}:w [color="{colour}"]'


def _room(text, inside, homes):
    """A frame around the blocks of the room, and around those that lead only to it or come only from it."""
    room = {number for number in inside if homes[number] == "room"}
    wires = [(wire["source"], wire["target"]) for wire in _WIRE.finditer(text)]
    for number in inside:
        ahead = {target for source, target in wires if source == number}
        behind = {source for source, target in wires if target == number}
        if homes[number] == "other" and any(ends and ends <= room for ends in (ahead, behind)):
            room.add(number)
    members = "\n".join(f"s{number}" for number in inside if number in room)
    style = 'label="room"\nlabeljust=l\nstyle="rounded,filled"\ncolor="#b79cc9"\nfillcolor="#faf6fc"'
    return f"subgraph cluster_room {{\n{style}\n{members}\n}}\n" if room else ""


def _titled(title, periods):
    class_name = title["type"].rpartition(".")[2]
    if title["name"] is None:
        return f"<B>{class_name}</B>"
    period = periods.get(html.unescape(title["name"]))
    below = class_name if period is None else f"{class_name}, {period}"
    return f'<B>{title["name"]}</B><BR/><FONT POINT-SIZE="10" COLOR="#555555">{below}</FONT>'


def _periods(diagram):
    """Block name -> "every 5 ms", for names that occur once."""
    periods_of = {}
    for row in schedule(diagram):
        periods_of.setdefault(row["block"], set()).add(row["period_s"])
    names = Counter(path.rpartition("::")[2] for path in periods_of)
    return {
        path.rpartition("::")[2]: "every " + " and ".join(f"{1e3 * period_s:.4g} ms" for period_s in sorted(periods))
        for path, periods in periods_of.items() if names[path.rpartition("::")[2]] == 1
    }


def _legend(looks):
    if looks <= {"other"}:
        return ""
    cells = "".join(f'<TD BGCOLOR="{tint}">{look}</TD>' for look, (tint, _) in COLOURS.items() if look in looks)
    return f'label=<<TABLE BORDER="0" CELLBORDER="1" CELLSPACING="4" COLOR="#aaaaaa"><TR>{cells}</TR></TABLE>>\n'


def _named(text, boxes):
    """Name nodes after their blocks: Drake's ids count all Systems of the process, and change from build to build."""
    names = {number: _name(box) for number, box in boxes.items()}
    often = Counter(names.values())
    ids = {}

    def rename(match):
        number, part = match["id"], match["part"]
        if number not in ids:
            name = names.get(number) or ""
            ids[number] = name if name.isidentifier() and often[name] == 1 else f"#{len(ids)}"
        return f'"{" ".join(filter(None, (match["kind"].strip("_s"), ids[number], part)))}"'

    return "\n".join(_NUMBER.sub(rename, line) if _STRUCTURE.match(line) else line for line in text.split("\n"))
