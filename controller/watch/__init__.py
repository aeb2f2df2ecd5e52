"""`treadwatch watch`: looks through the camera and listens to the base, without driving.

* command.py - opens base and camera, watches until it is told to end, and prints a summary
* no_base.py - in place of a base where there is none: a camera alone
* loop.py - one step: listens to the base, and decides as if the robot drove straight ahead
* result.py - what is added up from step to step
* view.py - what is printed of the present, once a second
* summary.py - what is printed at the end
"""
