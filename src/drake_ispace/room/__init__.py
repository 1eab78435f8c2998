"""The intelligent space: its settings, the localiser, the radio link."""
