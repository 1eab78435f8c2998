"""In the wire `fix`, between the room and the robot."""

EFFECTS = ()
