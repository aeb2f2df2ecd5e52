"""The planned path: where it goes and how fast it may be driven.

The files in the order in which they come into play:

* path.py - Path: the interface to all the rest of the program
* path_pieces.py - the path as a chain of pieces of constant curvature
* projection.py - path coordinates of points
* path_speeds.py - greatest speed along the path
"""
