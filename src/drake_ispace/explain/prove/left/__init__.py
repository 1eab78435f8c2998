"""What an answer leaves that is not noise of a sound robot, and what it goes with."""
