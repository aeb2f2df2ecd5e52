"""Cameras behind hal.api.FrameSource: a RealSense, folders of images (TUM format) and ROS bags.

realsense.py - an Intel RealSense D435i; realsense_sensors.py - the options of its sensors
device_clock.py - maps the camera's clock to the monotonic clock
recording.py - what every recording offers besides frames, and its frames one after the other
calibration.py - camera.yaml: intrinsics, scale, mount; rectifies raw images
registration.py - registers depth to colour
undistort.py - removes lens distortion
image_file.py - reads one image file
pose_track.py, pose_file.py - camera poses over time, and from a text file
gyro_track.py, gyro_file.py - gyro readings over time, and from a text file
tum_index.py, tum_replay.py - the index files of a folder, and the folder as a camera
tum_writer.py - writes such a folder (--record)
bag_file.py, bag_realsense.py - messages of a ROS bag, and the peculiarities of RealSense bags
bag_topics.py, bag_exposures.py - choose the topics, and tell when their messages were taken
bag_transforms.py, bag_calibration.py, bag_odometry.py, bag_gyro.py, bag_images.py - read the messages
stamp_pairing.py - pairs colour and depth images that arrive one by one
bag_replay.py - a ROS bag as a camera
paced_recording.py - plays a recording in real time, in place of a camera
"""
