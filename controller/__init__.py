"""The program: command line, composition, one control step, the loops that step it, and what measures it all.

The files and folders in the order in which they come into play:

* __main__.py, cli/ - the command `treadwatch`; errors.py - what a user can correct
* mission/ - `treadwatch run`; governor/ - `treadwatch govern`; watch/ - `treadwatch watch`; replay/ -
  `treadwatch replay`; ego_speed.py - the speed by the images, for the last two
* build.py, build_chassis.py - make the parts that the YAML asks for; path/ - the planned path
* lockstep.py, realtime/ - the loops: when a frame is looked at, and when the control steps
* perceive.py - a frame through vision/
* control.py - one control step, through all files from here to guard.py
* driven_base.py - the chassis with its pose and its response; drive_lifecycle.py - how a drive begins
  and ends
* localise.py - where the robot is; contradiction.py - when the images overrule the odometry
* decision/ - how fast it may go, and why
* response_monitor.py - whether the base does what it is told
* shape.py - the jerk-limited setpoint; chassis_lag.py - how much later the base follows
* braking.py, profile.py - formulas of stops and of speed profiles, for decision and shape
* follow.py - the yaw rate that keeps it on the path
* guard.py - the last check before the base
* record/, video/ - what is kept of a run; terminal/ - what is told of it
* bench/, campaign/, evaluation/, faults/ - measure speed, missions, perception and faults; workers.py - in
  parallel processes
"""

import os

# Perception has one core, and the matrices here are small: a second BLAS thread only waits for the first,
# up to ten times as long when both cores are busy. Has to be set before NumPy loads.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
