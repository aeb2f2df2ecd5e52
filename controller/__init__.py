"""The program: command line, composition, runners, decide, shape, path following, service."""

import os

# Perception has one core, and the matrices here are small: a second BLAS thread only waits for the first,
# up to ten times as long when both cores are busy. Has to be set before NumPy loads.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
