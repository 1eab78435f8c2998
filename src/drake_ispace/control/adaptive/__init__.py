"""Blocks of chapters 3 and 4 of the thesis: servo control, on-line identification and on-line adaptation."""
