"""Where the robot is: odometry, and what corrects it by the room's fixes."""
