"""`treadwatch evaluate`: the paper's evaluation (Daeef 2020), extended. It begins in evaluate.py.

The files in the order in which they come into play:

* evaluate.py - the command: simulated set, recordings, or both, into one report folder
* sequences.py - which simulated sequences there are, and which of them the detector may be tuned on
* scripted_drive.py - the robot's motion, its odometry, the camera mount
* scenes.py - the movers of a sequence, in one of the places
* places.py - hall, aisle and workshop: the room, what is fixed in it, and clutter
* run_set.py - runs all sequences on several processes
* run_sequence.py - runs all methods on one sequence; renders each frame once
* simulate.py - the frames of a sequence: image, odometry, truth
* truth.py - the truth about one frame
* types.py - the truth of a frame, and a method's output for it
* timed_methods.py - the compared methods, each timed
* ours.py - treadwatch as one of them
* lidar_scan.py, lidar_clusters.py, lidar_matching.py, lidar_baseline.py - the lidar baseline
* baselines/ - the camera baselines of the paper's Table 1
* eligibility.py - which true objects must be found in a frame
* assignment.py - the cheapest one-to-one assignment
* matching.py - which detection is which true object
* scoring.py - scores of one method on one sequence
* pixels.py - scores at pixel level
* endpoint_error.py - errors of the tracked fragments
* totals.py - the scores of many sequences as one set of figures
* summary.py - all figures, as JSON
* targets.py - what the detector has to reach
* paper.py - what the paper reports
* recordings.py - our detector on recordings
* recording_report.py - the report on recordings
* markdown.py, report_text.py - the text of the report on the simulated set
* chart.py, figures.py - its diagrams
* pictures.py - its camera images
* report.py - writes the report folder
"""
