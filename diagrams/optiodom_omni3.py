"""A three-wheel omni robot under a ceiling camera system (OptiOdom): what does its odometry lack, from circles alone?

Nominal values as its makers measured them (scenario optiodom_omni3). Effects are named on the circles; `held_out` is
the dead-reckoned position error over whole runs of motions never fitted to, root mean square over all fixes, pooled.
"""

from real_data import explain_odometry

explain_odometry(__doc__, "optiodom_omni3", "optiodom/omni3", "circular", ("square", "joystick"))
