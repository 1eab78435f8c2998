"""Stage 3: which effects the model lacks.

decide.py and joint.py are the two ways to decide, and begin the reading order. What they call stands in survey/ (what
every effect could explain), detect.py (whether anything is missing), propose.py, unknown.py (which effect, or none),
prune.py, rivals.py, left_over.py (what the runs support) and decision.py (the result).
"""
