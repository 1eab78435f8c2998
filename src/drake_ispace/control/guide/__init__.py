"""Guidance of the robot: paths, the way point that moves along them, and the trajectory tracker."""
