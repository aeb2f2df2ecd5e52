"""What is kept of a run: observations, video frames, recordings, and what the setpoints add up to."""
