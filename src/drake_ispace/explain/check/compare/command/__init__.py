"""Which instants of a commanded velocity does a log show?"""
