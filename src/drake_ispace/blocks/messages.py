"""Sizes of the messages that cross from one block to another; what each holds is said by the block that sends it."""

FIX = 5  # tick of capture, seen (1 or 0), x, y [m], phi [rad]
WAY_POINT = 10  # tick, x, y, phi, vx, vy, wz, ax, ay, yaw acceleration
TRACKING_ERROR = 5  # tick of the fix it refers to, tick of the way point, s_e, phi_h, speed fed forward
