"""The intelligent space: its settings, the localiser and the radio link to the robots."""
