"""The real-time runner: the control loop, the perception process beside it, and the service manager.

The files in the order in which they come into play:

* rig.py - chassis, simulated world, perception process and signals around the loop; drives along a path
  (controller/mission/realtime_drive.py) and the governor (controller/governor/command.py) begin here
* channel.py - a channel between the two processes; messages.py - what goes over it
* perception_process.py - camera, detect, track, recording, in a process of their own
* service.py - readiness, watchdog and stop signals (systemd)
* scheduling.py - SCHED_FIFO, locked memory, no garbage collection
* perception_link.py - what has come from perception
* runner.py - the loop of the control process
* punctual.py - sends each command at a fixed time within its period
"""
