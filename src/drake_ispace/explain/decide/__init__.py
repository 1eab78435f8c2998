"""Stage 3: which effects the model lacks.

decide.py begins the reading order; validate.py stands in its place for runs that are too short for a filter. What
decide.py calls stands in survey/ (what every effect could explain), proposals/ (whether anything is missing, and which
effects gain most), unknown.py (a library effect, or none), shown.py (which of these show more than noise), prune.py,
rivals.py, left_over.py (what the runs support) and decision.py (the result). each_part.py looks at every run by itself,
and at the halves of all runs, once there is an answer for all. clocks/ comes before: channels whose clock is off.
"""
