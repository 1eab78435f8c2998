"""What noise may leave of the gap: of the sensors, of the process, and of what no log holds."""
