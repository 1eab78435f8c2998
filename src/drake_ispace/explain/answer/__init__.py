"""Stage 4: the answer: sizes and channels in words, the scenario with the effects in it, proof on held-out runs."""
