"""Cameras behind hal.api.FrameSource: folders of images (tum_*), ROS bags (bag_*), a RealSense.

What recordings share: calibration, registration and undistort make colour, depth and lens agree; image_file,
stamp_pairing, pose_file and pose_track read what they hold. A folder goes tum_index -> tum_replay (--record
writes one: tum_writer), a bag bag_file -> bag_topics -> bag_calibration -> bag_replay. paced_recording lets a
recording stand in for a camera; device_clock brings realsense's time onto the machine's.
"""
