"""Stage 4: the gap as a user would measure it, and whether what the answer leaves is noise of a sound robot."""
