"""A differential drive under a ceiling camera system (OptiOdom): unequal wheels or a wrong base, from circles alone?

Nominal values as its makers measured them (scenario optiodom_diff). Squares and free driving are held out.
"""

from real_data import asked, optiodom_runs, show

import drake_ispace as di

options = asked(__doc__, chosen_effects=True)
held_out = optiodom_runs(options, "diff", "circular", "square", "free")
circles = held_out.pop("circular")
show(options, di.explain("optiodom_diff", circles, held_out, options.effects, tell=options.tell))
