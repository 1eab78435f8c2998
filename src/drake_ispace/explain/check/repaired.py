"""Repaired copies of recordings, on disk; the originals are never touched."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from drake_ispace.blocks.errors import InputError
from drake_ispace.explain.check.checked import Checked
from drake_ispace.files.recording import Recording, check_place


def save_repaired(checked: Checked, runs: Sequence[Recording], folder: Path) -> list[Path]:
    """Write each repaired run into `folder`, its notes saying what was done; a run that is cut as its parts.

    Runs without any finding are copied as they are, so that the folder holds all of them.

    Returns:
        The folders that were written.

    Raises:
        InputError: a folder that is no recording is in the way, or would replace one of the originals or lie in one.
    """
    copies = {}
    for i, (run, pieces) in enumerate(zip(runs, checked.repaired_parts(), strict=True)):
        name = run.path.name if run.path is not None else f"run_{i + 1}"
        done = [f"repaired, {one.fault}: {one.repair}" for one in checked.findings if i in one.runs and one.repairs]
        for k, piece in enumerate(pieces):
            place = folder / (name if len(pieces) == 1 else f"{name}_part_{k + 1}")
            if place in copies:
                place = place.with_name(f"{place.name}_{i + 1}")
            copies[place] = replace(piece, notes="\n".join([run.notes, *done]).strip(), path=place)
    originals = {run.path.resolve() for run in runs if run.path is not None}
    for place in copies:
        if any(place.resolve().is_relative_to(original) for original in originals):
            raise InputError(f"--repair {folder}: {place} is one of the runs or in one, expected another folder")
        check_place(place)
    for place, copy in copies.items():
        copy.save(place)
    return list(copies)
