"""The camera itself: its lens, its gyro, where it is mounted, and how far a frame can be trusted."""
