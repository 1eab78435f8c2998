"""From the logs of any robot to recordings, driven by a mapping file; docs/your_robot.md."""
