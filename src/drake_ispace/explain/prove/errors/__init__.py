"""Errors of the model along recorded runs, and plain least squares of them."""
