"""The program: command line, composition, one control step, the loops that step it, and what measures it all.

The files and folders in the order in which they come into play:

* __main__.py, cli/ - the command `treadwatch`; errors.py - what a user can correct
* mission/ - `treadwatch run`; governor/ - `treadwatch govern`; watch/ - `treadwatch watch`; replay/ -
  `treadwatch replay`
* build.py, build_chassis.py - make the parts that the YAML asks for; path/ - the planned path
* own_parts.py - refuses parts of the robot that its camera does not see, or that hide too much
* lockstep.py, realtime/ - the loops: when a frame is looked at, and when the control steps
* perceive.py - a frame through vision/
* control.py - one control step, through all files from here to follow.py, to the base and back
* base/ - the base while it is driven: where it is, whether it responds, how a drive begins and ends
* decision/ - how fast it may go, and why
* shape.py - the jerk-limited setpoint
* braking.py, profile.py - formulas of stops and of speed profiles, for decision and shape
* follow.py - the yaw rate that keeps it on the path
* record/, video/ - what is kept of a run; terminal/ - what is told of it
* bench/, campaign/, evaluation/, faults/ - measure speed, missions, perception and faults; workers.py - in
  parallel processes
"""

import os

# Perception has one core, and the matrices here are small: a second BLAS thread only waits for the first,
# up to ten times as long when both cores are busy. Has to be set before NumPy loads.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
