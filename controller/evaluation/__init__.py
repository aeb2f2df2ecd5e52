"""`treadwatch evaluate`: the paper's evaluation (Daeef 2020), extended. It begins in command.py.

Files and folders in the order in which they come into play:

* command.py - the command: simulated set, recordings, or both, into one report folder
* run_set.py - runs all sequences of the simulated set on several processes
* run_sequence.py - runs all methods on one sequence; renders each frame once
* simulated_set/ - the sequences, their frames with the truth, and what must be found in them
* methods/ - treadwatch, the lidar and the camera baselines
* types.py - what passes between the stages: the truth of a frame, and a method's output for it
* assignment.py - the cheapest one-to-one assignment, for methods and scores
* scores/ - a method's output against the truth: objects, pixels, ends of fragments
* recordings.py - our detector on recordings
* report/ - the summary and the report folder, with diagrams and pictures
"""
