"""Do the clocks of the channels agree? Offsets, drifts and jumps against the wheels' clock.

Motion itself is the clock: what a channel says of it is compared with what the wheels say some time earlier or later.
Reading order: paths.py (what a clock may do), losses.py and trial.py (one channel of one run under other clocks),
clocks.py (all runs together), latencies.py (a run beside the others), whose.py (the channel's clock or the wheels').
"""
