"""What benchmarks/rollout_speed.py compares with: a trig-free loop, hand-written C, plain Python, other simulators."""
