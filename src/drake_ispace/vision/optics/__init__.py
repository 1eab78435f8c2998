"""Where a camera's pixels lie in the room: its geometry, its calibration and the top view."""
