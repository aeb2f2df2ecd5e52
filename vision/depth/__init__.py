"""Depth without fragments: a coarse grid, the connected parts that stand out of the floor, free space.

Files, in the order in which they come into play:

* depth_noise - standard deviation of measured depth.
* depth_grid - the coarse grid of depth, with heights over the floor.
* own_cells - cells that show the robot itself, not its surroundings.
* cells - in which cell of the grid a pixel or a ray falls.
* depth_mask - near and far surface around pixels; the depth of fragments.
* connected - cells that stand out of the floor, and their connected parts.
* regions - box, centre and size of each part.
* occlusion - whether something nearer hides its sides or its lower end.
* rims - free rims: where a part ends in front of something farther.
* level_bands - the upright bands of the view in which free space is given.
* near_floor - learns how near to the camera the floor can be measured.
* free_space - the nearest surface and the known distance in each band: FreeSpace.
"""
