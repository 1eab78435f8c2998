"""Pictures of the room as its camera would take them."""
