"""Stage 5: the answer: verdict, sizes and channels in words, and the scenario with the effects in it."""
