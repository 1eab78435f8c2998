"""A three-wheel omni robot under a ceiling camera system (OptiOdom): what does its odometry lack, from circles alone?

Nominal values as its makers measured them (scenario optiodom_omni3). Squares and driving by joystick are held out.
"""

from real_data import asked, optiodom_runs, show

import drake_ispace as di

options = asked(__doc__, chosen_effects=True)
held_out = optiodom_runs(options, "omni3", "circular", "square", "joystick")
circles = held_out.pop("circular")
show(options, di.explain("optiodom_omni3", circles, held_out, options.effects, tell=options.tell))
