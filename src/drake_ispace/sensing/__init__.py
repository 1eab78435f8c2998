"""The robots' own sensors, sampled every tick, and the tilt filter."""
