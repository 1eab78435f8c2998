"""Stage 2: effects as numbers, the noise of residuals, and their likelihood."""
