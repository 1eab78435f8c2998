"""The room: its camera, and the radio link from the room to the robots."""
