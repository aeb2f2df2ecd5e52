"""`treadwatch bench`: measures the program's processing times on this machine. It begins in command.py.

The files in the order in which they come into play:

* command.py - the command: runs all measurements, one after the other
* machine.py - describes the machine; holds OpenCV to one thread
* progress.py - a progress bar
* figures.py - median and 99th percentile of durations
* reel.py - frames to measure perception on
* perception.py - perception, compared with bare OpenCV calls
* opencv_calls.py - records perception's OpenCV calls and times them alone
* own_search.py - OpenCV's Lucas-Kanade in place of perception's own, for the bare calls
* whole_images.py - the paper's OpenCV calls on whole images
* stages.py - time of each function inside perception
* rendering.py - the simulated camera
* driving.py, busy_scene.py - the control step among ten obstacles; exchanges with a chassis
* exchanges.py - the exchange of every chassis driver over every link
* mission_speed.py - lock-step simulation against real time
* report.py - all figures as JSON and as tables
* period.py - `treadwatch bench --period`: the command period in real time
"""
