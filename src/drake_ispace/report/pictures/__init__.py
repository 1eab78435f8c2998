"""Plots of runs and answers, and drawings of Diagrams, schedules and robots."""
