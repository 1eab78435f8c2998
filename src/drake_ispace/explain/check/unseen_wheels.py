"""Mistakes of the wheels where no camera sees the robot: one of them may explain what else several others would.

An IMU and what drives the robot, torques or a command, can each only be compared with the wheels. If the wheels change
places, the gyro seems to turn the other way, torques to change places as well, and in some runs neither to move with
the robot.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

from drake_ispace.explain.check.compare.drive_and_imu import command_columns_of, imu_columns_of, torque_columns_of
from drake_ispace.explain.check.compare.foreign import foreign
from drake_ispace.explain.check.compare.hypotheses import readings
from drake_ispace.explain.check.compare.links import Base
from drake_ispace.explain.check.compare.wheels_and_camera import repairs_of
from drake_ispace.explain.check.finding import Finding
from drake_ispace.faults.repair import repaired
from drake_ispace.files.recording import Recording
from drake_ispace.robots.robot import COMMAND, TORQUE

Bases = Sequence[Base | None]
_COLUMNS = {"imu": imu_columns_of, TORQUE: torque_columns_of, COMMAND: command_columns_of}
_AS_WELL = 0.95  # of how well channels follow by their own mistakes: what they must by one of the encoders


def mistaken_wheels(
    runs: Sequence[Recording], bases_of: Callable[[Sequence[Recording]], Bases], channels: Sequence[str]
) -> tuple[list[Finding], tuple[str, ...]]:
    """The mistake of all encoders without which some channels agree with them, if not one of these alone is accused.

    A finding for each run. Also the fault of the encoders that explains as much as the mistakes of the one that is.
    channels: IMU, torques, command, as far as there are.
    """
    bases, columns = bases_of(runs), [_COLUMNS[name] for name in channels]
    base, (blamed, follows) = next((one for one in bases if one is not None), None), _blamed(runs, bases, columns)
    if base is None or not blamed:
        return [], ()
    best, reading = 0.0, None
    for tried in readings(base.geometry, float(base.settings.encoder.counts_per_turn)):
        if tried.channel == "encoder" and not tried.rare:
            undone = [_undone(run, own, tried) for run, own in zip(runs, bases, strict=True)]
            well = _agreeing(undone, bases_of(undone), columns)
            if well > best:  # wheels that hardly turn accuse nobody either
                best, reading = well, tried
    if reading is None or best < _AS_WELL * follows:
        return [], ()
    accused = {finding.channel for finding in blamed}
    if len(accused) == 1 and "encoder" not in accused:
        return [], (reading.fault,)
    rivals = tuple(dict.fromkeys(finding.fault for finding in blamed))
    drop = sum(finding.drop_in_deviance for finding in blamed)
    return [
        Finding(
            reading.fault, reading.what, "encoder", drop_in_deviance=drop, rivals=rivals,
            repairs=repairs_of(reading, own), runs=(i,),  # whose columns may have names of their own
        ) for i, own in enumerate(bases) if own is not None
    ], ()


def with_rivals(findings: Sequence[Finding], faults: tuple[str, ...]) -> list[Finding]:
    """The findings, with faults of the encoders as rivals."""
    return [replace(one, rivals=tuple(dict.fromkeys((*one.rivals, *faults)))) for one in findings]


def _undone(run, base, reading):
    return run if base is None else repaired(run, repairs_of(reading, base))


def _blamed(runs, bases, columns) -> tuple[list[Finding], float]:
    """What the channels would be accused of, each by itself, and how well they follow the wheels without that.

    A channel whose columns are mistaken goes with the wheels in no run, and is no stranger for that.
    """
    each = [of(runs, bases) for of in columns]
    mistaken = [finding for one in each for finding in one.findings]
    accused = {finding.channel for finding in mistaken}
    strangers = [finding for finding in _strangers(runs, bases) if finding.channel not in accused]
    return mistaken + strangers, sum(one.follows for one in each if one.explained)


def _agreeing(runs, bases, columns) -> float:
    """How well the channels follow the wheels, all together; 0 where one does not, or is accused of anything."""
    together = 0.0
    for of in columns:
        agreement = of(runs, bases, True)
        if agreement.findings or not agreement.explained:
            return 0.0
        together += agreement.follows
    return 0.0 if _strangers(runs, bases) else together


def _strangers(runs, bases) -> list[Finding]:
    nothing = [()] * len(runs)
    return foreign(runs, bases, nothing, nothing)
