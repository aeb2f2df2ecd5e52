"""The camera itself: its gyro, its health, its mounting, the floor below it, and its lens.

Files, in the order in which they come into play within one frame:

* gyro - samples of the gyro, and the rotation between two frames.
* floor - finds the floor in the depth, for a camera without a known mounting.
* frozen_depth - whether depth repeats while the camera moves; used by health.
* health - how far a frame can be trusted.
* mount_check - whether the floor is where the mounting puts it.
* own_parts - takes parts of the robot out of the depth.
* own_parts_check - whether they are where they should be.
* seen_depth - the depth grid of a frame, with the floor and without the robot; what it shows of the mounting.
* lens - pixels to rays and back, rotation vectors; used throughout.
"""
