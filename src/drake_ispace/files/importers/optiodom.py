"""OptiOdom: wheeled robots under an OptiTrack ceiling system.

Source: R. B. Sousa, M. R. Petry, P. G. Costa, A. P. Moreira, "OptiOdom: A Generic Approach for Odometry Calibration of
Wheeled Mobile Robots", J. Intell. Robot. Syst. 2022; data at github.com/sousarbarb/optiodom (MIT licence).

A folder holds `run-01.csv`, ... without a header, columns t [s], x, y [m], theta [rad], then encoder counts per control
cycle (omni3: wheels 1 to 3; diff: right, left), and `metadata.csv` with one `key,value,...` per line.

What the data say about it:

- One turn of a wheel is ngear * encRes counts: encRes counts every edge already.
- The counts of an omni3 wheel rise as it drives clockwise around the robot. Here they are turned over, so that
  the geometry of an `omni3`, whose wheels 1 to 3 stand at -60, 60 and 180 degrees, maps them to the robot's velocity.
- The pose stamped t fits wheel angles stamped about half a cycle earlier (0.02 s). The stamps are left as they are.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from drake_ispace.blocks.errors import InputError, expected_one_of, shown
from drake_ispace.files.importers.tables import parse_numbers, period_of, read_lines
from drake_ispace.files.recording import Channel, Recording, validate

# kind: (robot, columns of the encoder, sign of a count)
_KINDS = {
    "omni3": ("omni3", ("theta_1", "theta_2", "theta_3"), -1.0),
    "diff": ("differential", ("theta_r", "theta_l"), 1.0),
}


@dataclass(frozen=True)
class Metadata:
    """The robot as `metadata.csv` describes it.

    Attributes:
        kind: "omni3" or "diff".
        gear: motor turns per wheel turn.
        counts_per_motor_turn: encoder counts per motor turn.
        wheel_distance_m: wheel to centre (omni3), wheel to wheel (diff) [m].
        diameters_m: of each wheel, in the order of the encoder's columns [m].
    """

    kind: str
    gear: float
    counts_per_motor_turn: float
    wheel_distance_m: float
    diameters_m: tuple[float, ...]

    @property
    def rad_per_count(self) -> float:
        return 2.0 * np.pi / (self.gear * self.counts_per_motor_turn)


def read_metadata(path: str | Path) -> Metadata:
    """The robot described in the file `path`; keys it does not need are passed over."""
    path = Path(path)
    entries = {}
    for line in read_lines(path):
        key, *cells = (cell.strip() for cell in line.split(","))
        entries[key] = [cell for cell in cells if cell]
    kind = (entries.get("type") or [""])[0]
    if kind not in _KINDS:
        raise InputError(f"{path}: type is {shown(kind)}, {expected_one_of(kind, _KINDS)}")
    gear, counts, distance = (_positive(entries, key, 1, path)[0] for key in ("ngear", "encRes", "Li"))
    return Metadata(kind, gear, counts, distance, _positive(entries, "Di", len(_KINDS[kind][1]), path))


def load_run(path: str | Path, metadata_path: str | Path | None = None) -> Recording:
    """The run in the file `path`: `encoder`, wheel angles since the first sample [rad], and `kinect`, the pose from the
    ceiling [m, m, rad].

    Both have the same stamps. phi is continuous over the run, not wrapped, as in the file. `metadata_path` is
    `metadata.csv` beside the run if None. Raises InputError for anything but such files.
    """
    path = Path(path)
    metadata = read_metadata(metadata_path or path.with_name("metadata.csv"))
    robot, wheels, sign = _KINDS[metadata.kind]
    table = parse_numbers(read_lines(path), path, ",", 4 + len(wheels))
    t, pose, counts = table[:, 0], table[:, 1:4], table[:, 4:]
    angles = sign * metadata.rad_per_count * (np.cumsum(counts, axis=0) - counts[0])
    period_s = period_of(t)
    pose = np.column_stack([pose[:, :2], np.unwrap(pose[:, 2])])
    units = {"x": "m", "y": "m", "phi": "rad"}
    recording = Recording(
        robot,
        channels={
            "encoder": Channel(t, wheels, angles, dict.fromkeys(wheels, "rad"), period_s),
            "kinect": Channel(t, ("x", "y", "phi"), pose, units, period_s),
        },
        notes=f"OptiOdom, {metadata.kind}, {path.parent.name}/{path.name}",
        path=path,
    )
    validate(recording, path)
    return recording


def load_folder(folder: str | Path) -> list[Recording]:
    """All `run-*.csv` of a folder with its `metadata.csv`, in the order of their names; there is at least one."""
    return [load_run(file) for file in runs_in(folder)]


def runs_in(folder: str | Path) -> list[Path]:
    """The files that `load_folder` loads."""
    folder = Path(folder)
    files = sorted(folder.glob("run-*.csv"))
    if not files:
        raise InputError(f"{folder}: expected a folder with files run-*.csv, there is none")
    return files


def _positive(entries: dict[str, list[str]], key: str, count: int, path: Path) -> tuple[float, ...]:
    """The `count` positive numbers under `key`."""
    cells = entries.get(key, [])
    try:
        numbers = tuple(float(cell) for cell in cells)
    except ValueError:
        numbers = ()
    if len(numbers) != count or not all(0.0 < number < np.inf for number in numbers):
        found = shown(",".join(cells)) if cells else "missing"
        raise InputError(f"{path}: {key} is {found}, expected {count} positive number{'s' if count > 1 else ''}")
    return numbers
