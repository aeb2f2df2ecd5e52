"""Helpers of the tests: what they are given, and doubles of what they talk to.

Made of known numbers, without images or devices:

* scenes.py - scenes and chassis states, for what comes after perception
* campaign.py - missions in the plane
* evaluation_cases.py - true objects, detections and images of the evaluation
* floor_bodies.py - boxes on the floor, for the decision
* sight_watch.py - a sight of a straight path, scene by scene
* recall.py - the memory of bodies out of view, scene by scene
* video_moments.py - a hall with a crossing person and a crate, for the video
* judging.py - evidence of motion, and the verdict on it
* ballots.py - votes of predicted cells for parts of the grid
* parts.py - parts and surfaces as vision/depth/regions.py measures them
* point_motion.py - points that move before a camera
* anchored_points.py - points anchored all over the view, and where they are seen after a motion

Depth and images:

* grids.py - depth grids made of planes and plates
* detections.py - detections without fragments, on exact depth grids
* painted_scans.py - the scan of free space of single painted frames
* walker.py - a plate that walks past, and what is found moving
* painted.py - RGB-D frames painted from textured rectangles
* painted_room.py - a painted room, and a crate to put into it
* own_bumper.py - a painted robot that sees its own bumper

Recordings and cameras:

* recordings.py - small TUM folders
* bags.py - small ROS bags, of ROS 1 and 2
* fake_realsense.py - a stand-in for pyrealsense2 that follows a script, also a bad one
* fake_realsense_frames.py - what it sends: frames, and samples of the gyro
* software_realsense.py - librealsense's own software device behind the genuine pyrealsense2

Chassis drivers with their emulators and links:

* arming_evidence.py - what a driver's arming is told of its base
* wires.py - links with a plug to pull, and a pseudo-terminal that keeps pace with simulated time
* serial_bench.py - a serial driver and its emulator on a wire in memory
* kobuki_bench.py - the same for a Kobuki
* roboclaw_bench.py - the same for a RoboClaw
* roboteq_bench.py - the same for a Roboteq
* agilex_bench.py - the AgileX driver alone, fed frame by frame
* chassis_rig.py - any driver and its emulator, stepped together in simulated time
* contract_rigs.py - every driver on every link, for the contract suite
* real_base.py - a real base in place of an emulator

Chassis for tests of what drives them:

* obedient_chassis.py - does at once what it is commanded, and notes it
* imperfect_base.py - lags, drops commands and sticks
* shaper_run.py - a shaper on a chassis that lags

Drives and decisions:

* decision_bench.py - a decision maker, and obstacles to show it
* path_drive.py - a control loop on a straight path, step by step
* closed_loop.py - a mission without a renderer: moving boxes, a noisy camera, a chassis with lag
* governed_drive.py - the same with the speed governor and a planner
* governor_rig.py - the governor's loop with a planner by the time and an obedient base
* runner_doubles.py - test doubles of what the runners step
* bench_clocks.py - clocks and progress of the bench
* hil_missions.py - short missions with the emulator as a process of its own
* drive_process.py - what a test asks of a drive that runs as a process of its own

Command line and pages:

* command_line.py - treadwatch as a user's shell runs it
* docs_pages.py - the code blocks of a page of docs/, pasted into a copy of the project
* docs_page_chassis.py - the chassis of docs/add-a-chassis.md
"""
