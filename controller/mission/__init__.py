"""`treadwatch run`: a drive along a path. It begins in command.py.

The files in the order in which they come into play:

* command.py - loads and checks, drives, prints the summary
* scenario_faults.py - the slip and the vibration that a scenario asks for
* possible_world.py - refuses a simulated world in which the robot cannot drive
* short_arcs.py - warns of arcs whose angle was given in radians
* close_by.py - warns of what stands too near to the path of a simulation
* unseen_bodies.py - warns of bodies of a simulation that are outside of its room, or set off too late
* floor_view.py - warns of a mounting from which the floor before the robot is not seen
* blind_bends.py - warns of bends that the camera cannot see round
* lockstep_drive.py - a drive in simulated time; realtime_drive.py - one in the rig of controller/realtime
* options.py - what it is told on the command line
* result.py - its result, added up from step to step; summary.py - what is printed of it
"""
