"""How fragments and bodies move over ground, and what evidence of motion that gives.

Files, in the order in which they come into play. In detect (vision/detector.py):

* expected - where the ends of fragments are expected in the next image.
* anchor_depths - what the depth of each anchored end is worth; running averages of depth.
* residuals - residual of each end against the prediction that it is static.

In track (vision/tracker.py):

* velocities - the linear equations for the velocity of a point over ground (eqs. 6 to 9).
* least_squares - velocities of fragments and of bodies from these equations.
* moving_fragments - which fragments move, which are static, and which move alike.
* one_edge - what fragments on one straight edge cannot tell of their body's motion.
* limbs - when to believe fragments of a body that disagree.
* sliding - when few fragments of a body tell nothing of its motion along the line of sight.
* line_of_sight - velocities along and across the line of sight, in their own sigmas.
"""
