"""The camera's own motion: a prior, a robust fit to static anchored ends, and the rolling shutter.

Files, in the order in which they come into play:

* motion_memory - what the frames before tell of the motion; chooses the prior.
* forward_speed - the robot's speed without odometry, filtered over the frames.
* motion_prior - the prior of the motion, from odometry, a gyro, or the motion before.
* reprojection - anchored points, and where they are seen now.
* pose_arrays - poses as arrays, moved and compared in compiled steps.
* robust_fit - robust Gauss-Newton on the reprojection error.
* lone_body - whether one body alone tells how the camera turns.
* camera_motion - the estimate: gates, the conflict with the prior, the covariance.
* rolling_shutter - correction of pixels for the sweep; learns the read-out time.
"""
