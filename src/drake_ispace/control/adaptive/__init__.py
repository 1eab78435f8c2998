"""Blocks that only chapters 3 and 4 of the thesis need: servo, identification and adaptation in the loop."""
