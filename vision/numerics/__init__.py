"""Numerics on small arrays, used by all other packages of vision.

* order - medians and quantiles by sorting; the variance that residuals show; places in ordered arrays.
* pose_axes - points and vectors between the two frames of a pose.
* relative_pose - points transformed between the axes of two poses.
* kalman - constant-velocity Kalman filters of all tracks at once.
"""
