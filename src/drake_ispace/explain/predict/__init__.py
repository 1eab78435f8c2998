"""Stage 1: what the model predicts for recorded runs, and the residuals, measured less predicted."""
