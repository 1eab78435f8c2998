"""In the wire `pose`, between the robot and what the room's camera says of it."""

EFFECTS = ()
