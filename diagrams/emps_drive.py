"""EMPS, a carriage on a rail (emps_carriage.py): the model is a mass alone; which frictions does it lack?

A simulation of the whole run drifts by 30 times the motion, which no single effect mends: effects are chosen by what
the model held on the motion could not predict. `steps`: simulations with one effect more at a time, the largest first.
"""
from emps_carriage import carriage, rail_runs, steps
from real_data import asked, show

import drake_ispace as di

options = asked(__doc__, half="explain the first half of the run alone")
model = carriage()
whole, first, second = rail_runs(options.data)
half = di.explain(model, [first], {"second half": [second]}, tell=options.tell)
if options.half:
    show(options, half)
else:
    answer = di.explain(model, [whole], tell=options.tell)
    show(options, answer, steps=steps(model, whole, answer), half=half.to_data())
