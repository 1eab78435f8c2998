"""The robots' own sensors, which are read every tick."""
