"""Stage 4: the answer, localised, confirmed on held-out runs, and put into words."""
