"""`treadwatch replay`: perceives and decides on a recording. It begins in command.py.

* command.py - puts every frame through detect, track and decide, and prints a summary
* build.py - makes perception, decision and the settings of a video for a recording
"""
