"""Which effects the data propose: is anything missing, which effects gain most, and where in the room."""
