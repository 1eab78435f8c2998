"""Many runs of one Diagram: what varies, the runs themselves on cores or a cluster, their numbers in a table."""
