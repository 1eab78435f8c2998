"""EMPS: a carriage on a rail, driven by a DC motor and a ball screw, the usual benchmark for friction.

Source: A. Janot, M. Gautier, M. Brunot, "Data Set and Reference Models of EMPS", Nonlinear System Identification
Benchmarks, 2019. `DATA_EMPS.mat` holds, at 1 kHz, `t` [s], position `qm` and reference `qg` [m], the voltage command
`vir` [V], the gain `gtau` from it to the force [N/V], and the controller's `kp` [1/s] and `kv` [V s/m].

What the data say about it: force and position have the same sign, no sample is limited, and the command is

    vir[k] = kv (kp (qg[k] - qm[k]) - (qm[k] - qm[k-2]) / 2T)

within 0.3 % of its norm: the speed is a backward difference over two samples.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from drake_ispace.blocks.errors import InputError, shown
from drake_ispace.files.importers.tables import period_of
from drake_ispace.files.recording import Channel, Recording, validate


@dataclass(frozen=True)
class Drive:
    """Gain of the drive [N/V] and of its position [1/s] and speed loop [V s/m]."""

    gain_n_v: float
    kp_per_s: float
    kv_v_s_m: float


def load_drive(path: str | Path) -> Drive:
    """The gains in the MATLAB file `path`; InputError if it is no such file."""
    data = _read(Path(path))
    return Drive(*(_vector(data, name, Path(path), 1)[0].item() for name in ("gtau", "kp", "kv")))


def load_run(path: str | Path, radius_m: float | None = None) -> Recording:
    """The run in the MATLAB file `path`, of robot "emps": `torque`, the commanded force, `encoder`, the position, and
    `reference`, the wanted position as x with y = phi = 0.

    A carriage has no wheel. With `radius_m` None `tau_1` is the force in N and `theta_1` the position in m, as
    `Channel.units` says; such a recording lives in memory only, since a folder takes N*m and rad. With `radius_m` they
    are those of a wheel of this radius that draws the carriage, in N*m and rad; with 1.0 the numbers are the same.

    Raises:
        InputError: the file is not the one described above.
        ValueError: `radius_m` is not positive.
    """
    path = Path(path)
    if radius_m is not None and not radius_m > 0.0:
        raise ValueError(f"radius_m is {radius_m}, expected a positive length or None")
    data, gain = _read(path), load_drive(path).gain_n_v
    t = _vector(data, "t", path)
    position, wanted, volts = (_vector(data, name, path, len(t)) for name in ("qm", "qg", "vir"))
    radius, period_s = 1.0 if radius_m is None else radius_m, period_of(t)
    reference = np.column_stack([wanted, np.zeros((len(t), 2))])
    recording = Recording(
        "emps",
        channels={
            "reference": Channel(t, ("x", "y", "phi"), reference, {}, period_s),
            "torque": Channel(t, ("tau_1",), gain * radius * volts[:, None], {"tau_1": "N*m"}, period_s),
            "encoder": Channel(t, ("theta_1",), position[:, None] / radius, {"theta_1": "rad"}, period_s),
        },
        notes=f"EMPS, {path.name}",
        path=path,
    )
    validate(recording, path)
    if radius_m is None:
        for name, column, unit in (("torque", "tau_1", "N"), ("encoder", "theta_1", "m")):
            recording.channels[name] = replace(recording.channels[name], units={column: unit})
    return recording


def _read(path: Path) -> dict[str, np.ndarray]:
    from scipy.io import loadmat

    if not path.is_file():
        raise InputError(f"{path}: expected a MATLAB file, there is none")
    try:
        return loadmat(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except Exception as error:  # a damaged file fails anywhere in loadmat
        reason = shown(str(error), 120)
        raise InputError(f"{path}: expected a MATLAB file (version 7.2 or older), but {reason}") from None


def _vector(data: dict[str, np.ndarray], name: str, path: Path, count: int | None = None) -> np.ndarray:
    """Finite real numbers (n,) of the variable `name`; n is `count` unless that is None."""
    if name not in data:
        raise InputError(f"{path}: variable {name!r} is missing, expected t, qm, qg, vir, gtau, kp and kv")
    value = np.asarray(data[name])
    if value.dtype.kind not in "fiu" or value.size != max(value.shape, default=1) or count not in (None, value.size):
        found = f"{value.dtype} {value.shape}"
        raise InputError(f"{path}: variable {name!r} is {found}, expected {count or 'a row or column of'} real numbers")
    vector = value.astype(float).ravel()
    if not len(vector) or not np.isfinite(vector).all():
        raise InputError(f"{path}: variable {name!r} holds no or not only finite numbers, expected finite ones")
    return vector
