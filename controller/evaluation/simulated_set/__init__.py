"""The simulated set: its sequences, and the frames of a sequence with their truth.

The files in the order in which they come into play:

* sequences.py - which sequences there are, and which of them the detector may be tuned on
* scripted_drive.py - the robot's motion, its odometry, the camera mount
* scenes.py - the movers of a sequence, in one of the places
* places.py - hall, aisle and workshop: the room, what is fixed in it, and clutter
* simulate.py - the world and the frames of a sequence: image, odometry, truth
* truth.py - the truth about one frame
* eligibility.py - which true objects must be found in a frame
"""
