"""Chassis drivers around one arming state machine. Each protocol has its own files.

driver.py - what all drivers share: arming, a link that may be lost, checks of the command
reading.py - reads all that has arrived on a serial link
outstanding.py - the one request whose answer is awaited, and how late it came; for RoboClaw and Roboteq
command.py - checks and limits a setpoint before it is sent
arming.py - the arming state machine
following.py - checks that the base follows its commands
rolling_back.py - checks that the base does not roll backwards
low_battery.py - tells of a voltage that stays low
tracks.py - skid-steer kinematics, dead reckoning, wrapping counters
other_master.py - detects a second master on the same CAN bus
disagreement.py - compares two sensors of the same motion
frame_age.py - how long a frame waited in buffers
encoder_feedback.py - speeds and pose from two encoders, for RoboClaw and Roboteq
agilex.py - AgileX driver; agilex_models.py, agilex_messages.py, agilex_serial.py, agilex_feedback.py
roboclaw.py - RoboClaw driver; roboclaw_port.py, roboclaw_packets.py, roboclaw_feedback.py
roboteq.py - Roboteq driver; roboteq_port.py, roboteq_lines.py, roboteq_feedback.py
kobuki.py - Kobuki driver; kobuki_packets.py, kobuki_feedback.py
"""
