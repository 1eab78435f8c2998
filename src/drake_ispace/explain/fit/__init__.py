"""Stage 2: effects as coordinates of a fit, the noise of residuals, and the likelihood of both."""
