"""From the floor on the robot: slip, and forces in the wire `ground_force`."""

EFFECTS = ()
