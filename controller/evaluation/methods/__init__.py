"""The compared methods: all get the same frames, and answer with the objects that move.

* timed_methods.py - all of them by name, each timed
* ours.py - treadwatch as one of them
* lidar_scan.py, lidar_clusters.py, lidar_matching.py, lidar_baseline.py - the lidar baseline
* baselines/ - the camera baselines of the paper's Table 1
"""
