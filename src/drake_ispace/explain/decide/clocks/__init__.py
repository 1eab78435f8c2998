"""Clocks of single channels that are off, told by what no effect explains."""
