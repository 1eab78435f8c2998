"""REGBOT: a small two-wheeled robot with gear motors, logged by itself.

A log starts with lines `%  7  8 Motor current left, right [A]: ...` that name columns (counted from 1) and give a first
sample, which is not read, then holds rows of numbers between blanks. Firmware versions log different columns.

What the data say about it:

- The battery's column is as its line says, although the range of the line sensor may include it.
- Positive voltage, current, speed and count drive the robot forwards.
- `motor_steps`: the wheels turn freely in the air (their inertia is that of the rotor and gear alone); logs 28 and 29
  are the same. Speed comes from the time between counts: it lags by about 3 ms, moves in steps of 4 %, and reads
  about 4 % higher than the counts rise.
- Accelerometer and gyro: x forwards, y to the right, z down; here turned to x forwards, y to the left, z up. Tilt is
  positive as the robot leans forwards.
"""

import re
from pathlib import Path

import numpy as np

from drake_ispace.blocks.errors import InputError
from drake_ispace.files.importers.tables import parse_numbers, period_of, read_lines
from drake_ispace.files.recording import Channel, Recording, validate

COUNTS_PER_WHEEL_TURN = 48 * 9.68  # edges per motor turn, gear: the counts then rise as pose x does, within 3 %
WHEEL_RADIUS_M = 0.03

# Words in the head of a log: what its columns are called here, in their order (left wheel first).
_NEEDED = {
    "Motor voltage": ("voltage_l", "voltage_r"),
    "Motor current": ("current_l", "current_r"),
    "Wheel velocity": ("speed_l", "speed_r"),
    "Pose x,y,h,tilt": ("x", "y", "phi", "tilt"),
}
_OPTIONAL = {
    "Battery voltage": ("battery",),
    "Acc x,y,z": ("ax", "ay", "az"),
    "Gyro x,y,z": ("wx", "wy", "wz"),
    "Encoder left, right": ("count_l", "count_r"),
}
_TRUTH_UNITS = {
    "x": "m", "y": "m", "phi": "rad", "tilt": "rad", "voltage_r": "V", "voltage_l": "V", "current_r": "A",
    "current_l": "A", "speed_r": "m/s", "speed_l": "m/s", "battery": "V",
}  # fmt: skip
_TO_FORWARD_LEFT_UP = np.array([1.0, -1.0, -1.0])


def load_log(path: str | Path) -> Recording:
    """The log in the file `path`, of robot "regbot".

    `truth` holds what the robot reckoned, measured and applied: `x`, `y` [m], `phi` [rad] from its own odometry, `tilt`
    [rad], `voltage_r`, `voltage_l` [V], `current_r`, `current_l` [A], `speed_r`, `speed_l` (rim of the wheel, m/s) and,
    if logged, `battery` [V]. A voltage is no wheel torque, so there is no channel `torque`.
    `encoder` (only where counts were logged) holds wheel angles since the first sample [rad], `imu` (where logged) the
    specific force and turning rate in axes forwards, left, up. Raises InputError for anything but such a log.
    """
    path = Path(path)
    lines = read_lines(path)
    first = _columns(lines, path)
    table = parse_numbers(lines, path)
    for name, index in first.items():
        if not 0 <= index < table.shape[1]:
            raise InputError(f"{path}: {name} is in column {index + 1}, expected 1 to {table.shape[1]} as in the rows")
    t, period_s = table[:, 0], period_of(table[:, 0])
    truth = tuple(name for name in _TRUTH_UNITS if name in first)
    channels = {
        "truth": Channel(
            t, truth, table[:, [first[name] for name in truth]], {name: _TRUTH_UNITS[name] for name in truth}, period_s
        )
    }
    if "count_l" in first:
        angles = np.column_stack([_angle(table[:, first[name]]) for name in ("count_r", "count_l")])
        channels["encoder"] = Channel(t, ("theta_r", "theta_l"), angles, {}, period_s)
    if "ax" in first and "wx" in first:
        force = table[:, first["ax"] : first["ax"] + 3] * _TO_FORWARD_LEFT_UP
        rate = np.deg2rad(table[:, first["wx"] : first["wx"] + 3]) * _TO_FORWARD_LEFT_UP
        channels["imu"] = Channel(
            t, ("ax", "ay", "az", "wx", "wy", "wz"), np.column_stack([force, rate]), {}, period_s
        )
    recording = Recording("regbot", channels=channels, notes=f"REGBOT, {path.parent.name}/{path.name}", path=path)
    validate(recording, path)
    return recording


def load_folder(folder: str | Path) -> list[Recording]:
    """All `*.txt` and `*.log` of a folder in the order of their names; there is at least one."""
    folder = Path(folder)
    files = sorted(file for ending in ("txt", "log") for file in folder.glob(f"*.{ending}"))
    if not files:
        raise InputError(f"{folder}: expected a folder with logs *.txt or *.log, there is none")
    return [load_log(file) for file in files]


def _columns(lines: list[str], path: Path) -> dict[str, int]:
    """Index of each column by its name, from the head of a log."""
    found: dict[str, int] = {}
    for line in lines:
        if not line.startswith("%") or line.startswith("%% Configuration"):
            break
        match = re.match(r"%\s+([0-9]{1,3})\b(.*)", line)
        for words, names in (_NEEDED | _OPTIONAL).items():
            if match and words in match[2]:
                found |= {name: int(match[1]) - 1 + offset for offset, name in enumerate(names)}
    for words, names in _NEEDED.items():
        if names[0] not in found:
            raise InputError(f"{path}: no line of the head names {words!r}, expected '%  7  8 {words} ...'")
    return found


def _angle(counts: np.ndarray) -> np.ndarray:
    """Wheel angle since the first sample [rad] from a counter (n,) of 32 bits that wraps."""
    steps = (np.diff(counts) + 2.0**31) % 2.0**32 - 2.0**31
    return 2.0 * np.pi / COUNTS_PER_WHEEL_TURN * np.concatenate([[0.0], np.cumsum(steps)])
