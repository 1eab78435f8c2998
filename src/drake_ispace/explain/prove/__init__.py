"""Stage 4: the gap as a user would measure it, and whether what the answer leaves is noise of a sound robot.

prove.py begins the reading order. What it calls stands in errors/ (of free runs, row by row), noise/ (what noise leaves
of them), left/ (what an answer leaves that is no noise), asked_for.py (what runs ask for to which nothing was fitted),
sizes.py (whose sizes are told) and proof.py (the result). own/ is the same for a plant of the user's own.
"""
