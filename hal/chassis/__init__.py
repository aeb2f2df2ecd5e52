"""Chassis drivers, one file a protocol, around one arming state machine."""
