"""Dynamics as Drake blocks: the plants of the robots, and what they share: wheels, slip, friction, actuator."""
