"""Mistakes that a log, or the typing in of a model, may have: a card each, and the repairs that undo them."""
