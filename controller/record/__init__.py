"""What is kept of a run.

recorder.py - all outputs of a run together
observations.py - one JSON line per frame
frame_recorder.py - writes frames in a background thread
output_isolation.py - a full disk ends an output, not a drive
tally.py - statistics of setpoints, durations and frames
"""
