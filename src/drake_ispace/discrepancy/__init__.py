"""The workflow that finds where simulation and measurement disagree, names the missing effect and proves it."""
