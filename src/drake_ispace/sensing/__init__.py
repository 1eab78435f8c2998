"""What the robots measure on themselves, every tick."""
