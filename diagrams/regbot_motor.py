"""REGBOT's gear motors under voltage steps, wheels in the air: which friction does an ideal DC motor lack?

The model and the runs are in regbot_motors.py. Other robots' logs and other steps are held out.
"""

from real_data import asked, show
from regbot_motors import motors, voltage_steps

import drake_ispace as di

options = asked(__doc__)
runs, held_out = voltage_steps(options.data, options.runs)
frictions = [di.effects()[name] for name in ("viscous_friction", "coulomb_friction", "stribeck_friction")]
show(options, di.explain(motors(runs), runs, held_out, frictions, tell=options.tell))
