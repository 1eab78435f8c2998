"""Robots found in pictures: markers, patterns of markers, and tracks through a video."""
