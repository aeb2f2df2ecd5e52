"""A world -> what an RGB-D camera in it reports, and the truth of it."""
