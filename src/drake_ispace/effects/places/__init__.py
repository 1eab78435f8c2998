"""The effects, a file for each place between command and camera at which they enter."""
