"""Where the robot shall be: paths, the way point on them, the tracker."""
