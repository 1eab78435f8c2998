"""Where simulation and measurement disagree, which effect is missing, and whether adding it closes the gap.

`explain.py` is the list of the four stages: 1 predict, 2 fit, 3 decide, 4 answer. Each is a folder of that name.
"""
