"""Emulated chassis at the other end of a link. Each speaks its real protocol and moves a plant.

base.py - what all emulators share
agilex.py, roboclaw.py, roboteq.py, kobuki.py - one protocol each
"""
