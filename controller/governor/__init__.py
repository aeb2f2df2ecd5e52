"""The speed governor: another planner asks for (v, w), treadwatch limits it to what is safe.

`treadwatch govern` begins in command.py. The files in the order in which they come into play:

* command.py - the command: governs until SIGTERM
* build.py - makes the parts from the configuration
* loop.py - one control step: takes a request, governs it, sends the setpoint, answers
* request.py - the messages: JSON in datagrams
* inbox.py - which request holds now
* governor.py - limits the request by the mission's decision
* arcs.py - from (v, w) to an arc as path
* arc_ahead.py - the arc that is looked along, and what is known of the way along it
* ground.py - remembers the floor around the robot
* ground_limits.py - limits by the remembered floor: start of an arc, turn in place
"""
