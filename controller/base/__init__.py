"""The base while it is driven: what stands between the control loops and hal/chassis/.

Nothing here knows of paths or decisions, or imports another part of the controller.
The files in the order in which they come into play:

* driven_base.py - the base with its pose and its response: what all control loops do alike in each step
* drive_lifecycle.py - how a drive begins and ends
* localise.py - where the robot is; contradiction.py - when the images overrule the odometry
* ego_speed.py - the speed by the images, where no base reports one
* response_monitor.py - whether the base does what it is told
* chassis_lag.py - how much later it follows, for shape.py
* guard.py - the last check before the base
"""
