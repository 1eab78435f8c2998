"""The part of the residuals that every effect could explain, and the noise that none explains.

generic.py and signatures.py compute the changes, view.py collects them around one point of the fit, screen.py tests
them, and survey.py puts it all together.
"""
