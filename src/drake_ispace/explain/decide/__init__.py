"""Stage 3: which effects the model lacks."""
