"""Channels compared with each other, as likelihoods of the ways in which they may be read.

Reading order: regression.py (how well one motion follows another), motion.py and links.py (what each channel says of
the robot's motion), agreement.py (a table of hypotheses), then what is tried: hypotheses.py with wheels_and_camera.py,
columns.py and ratio.py with drive_and_imu.py, foreign.py; at last the folders clocks and command.
"""
