"""Faults of the IMU: axes and gravity."""

from drake_ispace.faults.card import Fault

FAULTS = (
    Fault(
        "imu_axes", "axes of the IMU exchanged or negated",
        "columns of accelerometer or gyro change places or signs", "the board is mounted turned or upside down",
        "gravity is not along z, or turns and leans have the other sense", "put columns and signs in order",
    ),
    Fault(
        "gravity_missing", "an accelerometer without gravity",
        "az is 9.81 m/s^2 too small", "a driver subtracts gravity to be helpful",
        "az is near zero while the robot stands upright", "add gravity",
    ),
)
