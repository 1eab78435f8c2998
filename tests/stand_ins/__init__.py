"""Small models, runs and choices of effects that stand in for whole ones in tests of `explain`."""
