"""How the samples of one channel come, whatever other channels say."""
