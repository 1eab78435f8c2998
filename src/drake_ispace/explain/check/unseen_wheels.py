"""Mistakes of the wheels where no camera sees the robot: one of them may explain what else several others would.

An IMU and torques can each only be compared with the wheels. If the wheels change places, the gyro seems to turn the
other way, torques to change places as well, and in some runs neither to move with the robot.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

from drake_ispace.explain.check.compare.agreement import RELATED
from drake_ispace.explain.check.compare.drive_and_imu import imu_columns_of, torque_columns_of
from drake_ispace.explain.check.compare.foreign import foreign
from drake_ispace.explain.check.compare.hypotheses import Reading, readings
from drake_ispace.explain.check.compare.links import Base
from drake_ispace.explain.check.compare.wheels_and_camera import repairs_of
from drake_ispace.explain.check.finding import Finding
from drake_ispace.faults.repair import repaired
from drake_ispace.files.recording import Recording

Bases = Sequence[Base | None]
_COLUMNS = (imu_columns_of, torque_columns_of)


def mistaken_wheels(
    runs: Sequence[Recording], bases_of: Callable[[Sequence[Recording]], Bases]
) -> tuple[list[Finding], tuple[str, ...]]:
    """The mistake of the encoders of all runs without which IMU and torques agree with them, if these have several.

    Also the faults of encoders that explain as much as the one mistake of IMU or torques.
    """
    bases = bases_of(runs)
    base, blamed = next((one for one in bases if one is not None), None), _blamed(runs, bases)
    if base is None or not blamed:
        return [], ()
    follows: list[tuple[float, Reading]] = []
    for reading in readings(base.geometry, float(base.settings.encoder.counts_per_turn)):
        if reading.channel == "encoder" and not reading.rare:
            undone = [repaired(run, repairs_of(reading, base)) for run in runs]
            if well := _agreeing(undone, bases_of(undone)):
                follows.append((well, reading))
    # wheels that hardly turn by a reading accuse nobody either
    follows.sort(key=lambda one: -one[0])
    alike = [reading for well, reading in follows if well > (1.0 - RELATED) * follows[0][0]]
    faults = tuple(dict.fromkeys(reading.fault for reading in alike))
    if not alike or len(blamed) == 1:
        return [], faults
    rivals = dict.fromkeys((*faults[1:], *(finding.fault for finding in blamed)))
    drop = sum(finding.drop_in_deviance for finding in blamed)
    return [Finding(
        alike[0].fault, alike[0].what, "encoder", drop_in_deviance=drop, rivals=tuple(rivals),
        repairs=repairs_of(alike[0], base), runs=tuple(range(len(runs))),
    )], ()


def with_rivals(findings: Sequence[Finding], faults: tuple[str, ...]) -> list[Finding]:
    """The findings, with faults of the encoders as rivals of those that accuse whole channels beside them."""
    return [
        replace(one, rivals=(*one.rivals, *faults)) if one.channel in ("imu", "torque") and one.repairs else one
        for one in findings
    ]


def _blamed(runs, bases) -> list[Finding]:
    """What IMU and torques would be accused of, each by itself."""
    return [finding for of in _COLUMNS for finding in of(runs, bases).findings] + _strangers(runs, bases)


def _agreeing(runs, bases) -> float:
    """How well IMU and torques follow the wheels, both together; 0 where one does not, or is accused of anything."""
    together = 0.0
    for of in _COLUMNS:
        agreement = of(runs, bases)
        if agreement.findings or not agreement.explained:
            return 0.0
        together += agreement.follows
    return 0.0 if _strangers(runs, bases) else together


def _strangers(runs, bases) -> list[Finding]:
    nothing = [()] * len(runs)
    return foreign(runs, bases, nothing, nothing)
