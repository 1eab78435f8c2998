"""Between a commanded body velocity and the one that a robot follows: effects in the wire `velocity`."""

EFFECTS = ()
