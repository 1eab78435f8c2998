"""Stage 1: what the model predicts for recorded runs, and what is left of the measurement."""
