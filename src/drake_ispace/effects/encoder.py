"""In the wire `wheel_angle`, between wheel and encoder."""

EFFECTS = ()
