"""EMPS, a carriage on a rail (emps_carriage.py): the model is a mass alone; which frictions does it lack?

A simulation of the whole run drifts by 30 times the motion, which no single effect mends: effects are chosen by what
the model held on the motion could not predict. `steps`: simulations with one effect more at a time, the largest first.
"""
from emps_carriage import ForceOffset, carriage, rail_runs, steps
from real_data import asked, show

import drake_ispace as di

options, model, effects = asked(__doc__), carriage(), [*di.effects().values(), ForceOffset()]
whole, first, second = rail_runs(options.data)
how = {"effects": effects, "tell": options.tell}
answer, half = di.explain(model, [whole], **how), di.explain(model, [first], {"second half": [second]}, **how)
show(options, answer, steps=steps(model, whole, answer, effects), half=half.to_data())
