"""Identification of the pendulum, chapters 3 and 4 of the thesis."""
