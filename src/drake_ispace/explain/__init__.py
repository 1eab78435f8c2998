"""Where simulation and measurement disagree, which effect is missing, and whether adding it closes the gap.

`explain.py` lists the six stages: 0 check, 1 predict, 2 fit, 3 decide, 4 prove, 5 answer. Each is a
folder of that name.
"""
