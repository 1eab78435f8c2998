"""A differential drive under a ceiling camera system (OptiOdom): unequal wheels or a wrong base, from circles alone?

Nominal values as its makers measured them (scenario optiodom_diff). Effects are named on the circles; `held_out` is the
dead-reckoned position error over whole runs of each kind of motion, root mean square over all fixes, pooled over runs.
The circles are the training runs: their error is not held out, squares and free driving are.
"""

from real_data import explain_odometry

explain_odometry(__doc__, "optiodom_diff", "optiodom/diff", "circular", ("circular", "square", "free"))
