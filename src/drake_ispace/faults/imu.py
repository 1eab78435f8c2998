"""Faults of the IMU: axes, gravity, zero and scale."""

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
    Fault(
        "gyro_off", "a gyro with another zero or scale",
        "wz is off by a constant, or by a factor",
        "a gyro that was not calibrated, has warmed up, or is set to another range",
        "the camera sees the robot turn by more or less, or not at all", "take the rate at rest off, and scale wz",
        harmless=True,
    ),
)
