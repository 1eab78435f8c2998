"""Pictures and videos from files, and what is said of the scene they show."""
