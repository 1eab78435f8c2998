"""What the fixes of a camera show by themselves, and beside the wheels: outliers, smoothing, poses that are none."""
