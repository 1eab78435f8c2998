"""Stage 3: which effects the model lacks.

decide.py begins the reading order; validate.py stands in its place for runs that are too short for a filter. What
decide.py calls stands in survey/ (what every effect could explain), detect.py (whether anything is missing),
propose.py, unknown.py (which effect, or none), shown.py (which of these show more than noise), prune.py, rivals.py,
left_over.py (what the runs support) and decision.py (the result). each_part.py looks at every run by itself, and
at the halves of all runs, once there is an answer for all.
"""
