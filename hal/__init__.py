"""Everything that touches the outside of the program: cameras, chassis, links and clocks.

types.py - data that crosses the boundary: frames, poses, setpoints, chassis state
api.py - the protocols that every camera, chassis and link implements
errors.py - the tree of errors that they raise
records.py - dataclasses that are quick to make
clocks.py - the monotonic clock, and a simulated one
geometry.py - transforms between floor, body and camera
box_view.py - where the camera sees a box that is fixed to the robot
directions.py - parts of vectors along a direction, for compiled loops
compiled.py - compilation of loops with Numba
step_records.py - records as arguments of compiled loops
device_wrapper.py - base class of wrappers that open and close what they wrap
links/ - CAN, serial and datagram links
chassis/ - chassis drivers
cameras/ - cameras and recordings
"""
