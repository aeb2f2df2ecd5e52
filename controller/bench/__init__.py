"""Measure the program on this machine: medians and ratios of one run."""
