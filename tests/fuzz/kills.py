"""Writers killed at any moment: what lies there afterwards is one whole version, and the next good run leaves no trace.

    python -m fuzz.kills --kills 300 [--writer recording ...] [--seed 0]      (in the folder tests)

prints for each writer how many of its kills left something that cannot be read, something mixed, or files that the next
good run did not clear away. Each kill hits a process of its own that writes one version after the other.
"""

import argparse
import json
import os
import random
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import answers
from drake_ispace.files.recording import Channel, Recording
from drake_ispace.hiding import save_hidden
from drake_ispace.report.explain_page import write_explanation
from drake_ispace.robots.recordings import load
from drake_ispace.rollout.many.campaign import montecarlo
from drake_ispace.rollout.many.table import read_campaign
from drake_ispace.scenario import load_scenario

_ROWS = 400


class Writer:
    """Something that replaces what lies at a place by another version of it.

    Attributes:
        longest_s: time within which the kill comes. share: of all kills.
    """

    longest_s = 0.03
    share = 0.25

    def write(self, version: int, place: Path) -> None:
        """Write a version, a whole number of at least 1."""
        raise NotImplementedError

    def prepare(self, place: Path) -> None:
        """Make the place ready for a kill."""

    def version(self, place: Path) -> int:
        """The version that lies there.

        Raises:
            Mixed: parts of several. Exception: it cannot be read.
        """
        raise NotImplementedError


class Mixed(Exception):
    """Parts of several versions lie there."""


def only(versions) -> int:
    """The one version that all parts are of."""
    found = set(versions)
    if len(found) != 1:
        raise Mixed(f"versions {sorted(found)[:5]}")
    return int(found.pop())


def run(version: int) -> Recording:
    t, angles = 0.005 * np.arange(_ROWS), np.full((_ROWS, 4), float(version))
    return Recording("omni", None, {
        "encoder": Channel(t, tuple(f"theta_{i}" for i in range(1, 5)), angles),
        "torque": Channel(t, tuple(f"tau_{i}" for i in range(1, 5)), angles),
    }, str(version))


def version_of(recording: Recording) -> int:
    values = [value for channel in recording.channels.values() for value in np.unique(channel.values)]
    if any(len(channel.t) != _ROWS for channel in recording.channels.values()) or len(recording.channels) != 2:
        raise Mixed("rows or channels are missing")
    return only([*values, float(recording.notes)])


@dataclass
class RecordingWriter(Writer):
    format: str

    def write(self, version, place):
        run(version).save(place / "run", self.format)

    def version(self, place):
        return version_of(load(place / "run"))


class HideWriter(Writer):
    share = 0.15

    def write(self, version, place):
        save_hidden({"a": run(version), "b": run(version)}, "omni", {}, version, place / "hidden")

    def version(self, place):
        answer = json.loads((place / "hidden" / "answer.json").read_text())
        return only([answer["seed"], *(version_of(load(place / "hidden" / name)) for name in "ab")])


class JsonWriter(Writer):
    share = 0.15

    def write(self, version, place):
        answers.named(load_scenario("omni_multirate"), seconds=float(version)).save(place / "answer.json")

    def version(self, place):
        return int(json.loads((place / "answer.json").read_text())["seconds"])


class ReportWriter(Writer):
    longest_s = 4.0
    share = 0.1

    def write(self, version, place):
        model = load_scenario("omni_multirate")
        said = answers.named(model, seconds=float(version), warnings=[f"version {version}!"])
        write_explanation(said, model, [], [], place / "report")

    def version(self, place):
        folder = place / "report"
        page, found = (folder / "index.html").read_text(), json.loads((folder / "explanation.json").read_text())
        if f"version {int(found['seconds'])}!" not in page or not (folder / "after.svg").is_file():
            raise Mixed("page and data are of different versions")
        return int(found["seconds"])


class CampaignWriter(Writer):
    """Rows only ever come in addition: whatever lies there is a part of the one table."""

    longest_s = 3.0
    share = 0.1

    def prepare(self, place):
        shutil.rmtree(place / "campaign", ignore_errors=True)

    def write(self, version, place):
        scenario, vary = load_scenario("omni_multirate", ["seconds=0.05"]), {"omni_plant.mass_kg": "uniform(7, 8)"}
        montecarlo(scenario, 4000, vary=vary, seed=3, out=place / "campaign", threads=1)

    def version(self, place):
        if not (place / "campaign" / "campaign.yaml").exists():
            return 1  # killed before it began
        rows = read_campaign(place / "campaign").to_pylist()
        if len({row["run"] for row in rows}) != len(rows):
            raise Mixed("a run twice")
        return 1


WRITERS: dict[str, Writer] = {
    "recording": RecordingWriter("csv"), "parquet": RecordingWriter("parquet"), "hide": HideWriter(),
    "json": JsonWriter(), "report": ReportWriter(), "campaign": CampaignWriter(),
}


def in_a_process(task) -> int:
    """Start `task` in a process of its own; its number."""
    sys.stdout.flush()
    child = os.fork()
    if child:
        return child
    code = 1
    try:
        task()
        code = 0
    except Mixed:
        code = 2
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)


def ends(child: int) -> int:
    """The exit code of a process."""
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def kill(writer: Writer, place: Path, source: random.Random) -> str:
    """What a kill comes to: "fine", "unreadable", "mixed", "leftovers", or "failed" where no good run followed."""
    def forever():
        version = 2
        while True:
            writer.write(version, place)
            version += 1

    writer.prepare(place)
    child = in_a_process(forever)
    time.sleep(source.uniform(0.0, writer.longest_s))
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    if code := ends(in_a_process(lambda: writer.version(place))):
        return "mixed" if code == 2 else "unreadable"
    if ends(in_a_process(lambda: writer.write(1, place))):
        return "failed"
    return "leftovers" if [name for name in os.listdir(place) if name.startswith(".")] else "fine"


def attack(name: str, kills: int, seed: int) -> Counter:
    """How often each outcome was."""
    writer, source = WRITERS[name], random.Random(f"{seed}/{name}")
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        if ends(in_a_process(lambda: writer.write(1, place))):
            return Counter({"failed": kills})
        return Counter(kill(writer, place, source) for _ in range(kills))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=300, help="of all writers together")
    parser.add_argument("--writer", nargs="+", choices=list(WRITERS), default=list(WRITERS))
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    shares = {name: WRITERS[name].share for name in options.writer}
    bad = 0
    for name, share in shares.items():
        kills = max(1, round(options.kills * share / sum(shares.values())))
        counts = attack(name, kills, options.seed)
        bad += kills - counts["fine"]
        said = ", ".join(f"{counts[what]} {what}" for what in ("fine", "unreadable", "mixed", "leftovers", "failed"))
        print(f"{name}: {kills} kills, {said}", flush=True)
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main()
