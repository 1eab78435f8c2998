"""Feedback laws, which turn tracking errors into commands, their gains, and friction compensation."""
