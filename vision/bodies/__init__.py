"""Obstacles: parts of the view become bodies with an id, a velocity and a verdict."""
