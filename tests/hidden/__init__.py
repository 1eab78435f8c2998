"""Runs of two robots with hidden effects, from equations written apart from those of the package."""
