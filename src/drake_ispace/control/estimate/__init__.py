"""Estimation of the robot's pose: odometry, and its correction by the room's fixes."""
