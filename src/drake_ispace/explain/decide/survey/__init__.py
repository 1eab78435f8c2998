"""What every effect could explain of the residuals: their changes by it, and the noise that no effect explains.

generic.py and signatures.py compute the changes, view.py collects them around one point of the fit, screen.py tests
them, and survey.py puts it all together.
"""
