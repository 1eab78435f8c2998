"""The files of a recording as plain tables: read, changed and written with NumPy and YAML alone."""

import shutil
from pathlib import Path

import numpy as np
import yaml


class Folder:
    """A recording's folder: `tables` name -> (columns after t, array with t first)."""

    def __init__(self, path: Path):
        self.path = path
        self.data = yaml.safe_load((path / "recording.yaml").read_text(encoding="utf-8"))
        self.tables = {name: self._read(entry) for name, entry in self.data["channels"].items()}

    def _read(self, entry):
        """Columns and numbers; without the time of arrival, which a changed stamp would contradict."""
        header = (self.path / entry["file"]).read_text(encoding="utf-8").split("\n", 1)[0].split(",")
        kept = [i for i, name in enumerate(header) if name != "t_received"]
        entry.get("units", {}).pop("t_received", None)
        table = np.loadtxt(self.path / entry["file"], delimiter=",", skiprows=1, ndmin=2)[:, kept]
        return [header[i] for i in kept][1:], table

    def column(self, channel: str, name: str) -> int:
        """The place of a column in the array of a channel."""
        return 1 + self.tables[channel][0].index(name)

    def write(self, to: Path) -> Path:
        """Write the folder anew; a period that the stamps no longer have is left out."""
        shutil.rmtree(to, ignore_errors=True)
        to.mkdir(parents=True)
        for name, (columns, values) in self.tables.items():
            entry = self.data["channels"][name]
            entry.pop("period_s", None)
            header = ",".join(["t", *columns])
            np.savetxt(to / entry["file"], values, delimiter=",", header=header, comments="", fmt="%.17g")
        (to / "recording.yaml").write_text(yaml.safe_dump(self.data), encoding="utf-8")
        for other in self.path.glob("scenario.yaml"):
            shutil.copy(other, to / other.name)
        return to
