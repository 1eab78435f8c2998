"""What is written takes its place as a whole, and what killed processes leave is cleared away."""

import os
import subprocess
import sys

import pytest

from drake_ispace.blocks.errors import InputError
from drake_ispace.files import places
from drake_ispace.files.places import (
    CONTENTS,
    beside,
    check_folder,
    clear_leftovers,
    fresh_folder,
    put_in_place,
    whole_file,
)


@pytest.fixture
def dead(monkeypatch):
    """A function: a path beside another as a process made it that is no more."""
    done = subprocess.Popen([sys.executable, "-c", ""])
    done.wait()

    def beside_of_dead(out):
        with monkeypatch.context() as patched:
            patched.setattr(places.os, "getpid", lambda: done.pid)
            return beside(out)

    return beside_of_dead


def written(out, *names):
    with fresh_folder(out, "a report") as fresh:
        for name in names:
            (fresh / name).write_text(name)


def names_in(folder):
    return sorted(entry.name for entry in folder.iterdir())


@pytest.mark.parametrize("can_exchange", [True, False])
def test_a_new_folder_replaces_the_old_one_as_a_whole(tmp_path, monkeypatch, can_exchange):
    if not can_exchange:
        monkeypatch.setattr(places, "_exchanged", lambda one, other: False)
    written(tmp_path / "out", "a", "b")
    written(tmp_path / "out", "b", "c")
    assert names_in(tmp_path) == ["out"] and names_in(tmp_path / "out") == [CONTENTS, "b", "c"]


def test_the_system_exchanges_two_folders_in_one_step(tmp_path):
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
        (tmp_path / name / name).touch()
    if not places._exchanged(tmp_path / "one", tmp_path / "other"):
        pytest.skip("this file system cannot")
    assert names_in(tmp_path / "one") == ["other"] and names_in(tmp_path / "other") == ["one"]


def test_what_goes_wrong_leaves_the_old_folder(tmp_path):
    written(tmp_path / "out", "a")
    with pytest.raises(KeyboardInterrupt), fresh_folder(tmp_path / "out") as fresh:
        (fresh / "b").touch()
        raise KeyboardInterrupt
    assert names_in(tmp_path) == ["out"] and names_in(tmp_path / "out") == [CONTENTS, "a"]


def test_a_file_of_the_user_is_not_replaced(tmp_path):
    written(tmp_path / "out", "a")
    (tmp_path / "out" / "notes.txt").touch()
    with pytest.raises(InputError, match=r"notes\.txt: is no part of a report to replace, expected it moved elsewhere"):
        written(tmp_path / "out", "a")


def test_a_folder_of_another_kind_is_not_replaced(tmp_path):
    (tmp_path / "notes.txt").touch()
    with pytest.raises(InputError, match="holds something else than a report, expected a new or an empty folder"):
        written(tmp_path, "a")
    assert names_in(tmp_path) == ["notes.txt"]


def test_leftovers_of_dead_processes_are_cleared_and_those_of_living_ones_stay(tmp_path, dead):
    out = tmp_path / "out"
    dead(out).mkdir()
    dead(out).touch()
    mine = beside(out)
    mine.mkdir()
    elsewhere = tmp_path / f".out.{'0' * 8}.{os.getpid()}.x.new"
    elsewhere.touch()
    clear_leftovers(out)
    assert names_in(tmp_path) == sorted([mine.name, elsewhere.name])


def test_what_was_about_to_be_replaced_is_put_back(tmp_path, dead):
    out = tmp_path / "out"
    old = dead(out).with_suffix(".old")
    old.mkdir()
    (old / "a").touch()
    clear_leftovers(out)
    assert names_in(tmp_path) == ["out"] and names_in(out) == ["a"]


def test_an_original_that_is_there_again_is_not_overwritten(tmp_path, dead):
    out = tmp_path / "out"
    dead(out).with_suffix(".old").mkdir()
    out.mkdir()
    (out / "new").touch()
    clear_leftovers(out)
    assert names_in(tmp_path) == ["out"] and names_in(out) == ["new"]


def test_a_failed_rename_puts_the_old_folder_back(tmp_path, monkeypatch):
    monkeypatch.setattr(places, "_exchanged", lambda one, other: False)
    written(tmp_path / "out", "a")
    fresh = beside(tmp_path / "out")  # does not exist
    with pytest.raises(OSError):
        put_in_place(fresh, tmp_path / "out")
    assert names_in(tmp_path / "out") == [CONTENTS, "a"]


def test_a_whole_file_keeps_its_suffix_and_clears_leftovers(tmp_path, dead):
    dead(tmp_path / "a.png").touch()
    with whole_file(tmp_path / "a.png") as fresh:
        assert fresh.suffix == ".png" and fresh.parent == tmp_path
        fresh.write_text("x")
    assert names_in(tmp_path) == ["a.png"]


KILLED = """
import os, sys
from pathlib import Path
from drake_ispace.files.places import fresh_folder
out, count = Path(sys.argv[1]), 0
while True:
    count += 1
    with fresh_folder(out) as fresh:
        for name in "abcdef":
            (fresh / name).write_text(str(count))
    if count == 1:
        print("ready", flush=True)
"""


def test_the_trial_of_a_dead_process_is_cleared_by_the_next(tmp_path, dead):
    out = tmp_path / "out"
    written(out, "a")
    dead(out / "out").mkdir()  # a folder that exists is tried from within
    dead(tmp_path / tmp_path.name).mkdir()
    written(out, "b")
    check_folder(tmp_path)
    assert names_in(out) == [CONTENTS, "b"] and names_in(tmp_path) == ["out"]


def test_a_killed_writer_leaves_one_whole_generation(tmp_path):
    for delay in (0.0, 0.003, 0.01):
        out = tmp_path / "out"
        writer = subprocess.Popen([sys.executable, "-c", KILLED, out], stdout=subprocess.PIPE, text=True)
        assert writer.stdout.readline() == "ready\n"
        try:
            writer.wait(delay)
        except subprocess.TimeoutExpired:
            writer.kill()
        writer.wait()
        assert len({(out / name).read_text() for name in "abcdef"}) == 1
        written(out, *"abcdef")
        assert names_in(tmp_path) == ["out"]
