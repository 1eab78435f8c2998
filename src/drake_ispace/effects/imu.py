"""In the wire `body_motion`, between the body and its IMU."""

EFFECTS = ()
