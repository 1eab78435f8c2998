"""Estimation, tracking and feedback: what runs on the robots' controllers and on the room's computer."""
