"""`treadwatch faults`: what happens when something breaks, measured, for every chassis."""
