"""Cameras: TUM-folder replay, RealSense."""
