"""Other people's data sets as recordings."""
