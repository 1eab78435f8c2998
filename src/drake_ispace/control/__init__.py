"""Estimation, tracking and feedback, which run on the robots' controllers and on the room's computer."""
