"""Perception: RgbdFrame -> Scene, by the featured-fragment detector of Daeef 2020 with safety extensions.

Files and folders, in the order in which they come into play within one frame:

* perception - detect and track, composed: the entry point.
* detector - detect: a frame becomes a Detection (detection).
  It uses depth/, camera/, fragments/, ego_motion/, motion/.
* tracker - track: a Detection becomes a Percept (percept), which contains the Scene (scene).
  It uses depth/, bodies/, motion/.
* numerics/ - filters, medians and transforms on small arrays.

Terms:

* fragment: a short line segment in the image, tracked from frame to frame; end: one of its two end points.
* fixed frame: the coordinate frame in which the detector keeps the camera's pose and the tracker its tracks.
* anchor of an end: the position of that end some frames ago, with its depth, in the fixed frame.
* cell: one element of the coarse depth grid (vision/depth/depth_grid.py), for a block of a few pixels.
* part: cells of one frame that are connected without a jump in depth (vision/depth/connected.py). Parts have
  no history.
* body: a physical thing, such as a person or a vehicle. Depth may merge two bodies or split one.
* track: what is kept of one body from frame to frame: id, filter, verdict (vision/bodies/tracks.py). Comments
  on slip and vibration, however, mean the crawler tracks on which the robot drives.
* verdict: whether a track moves or is static, decided with hysteresis (vision/bodies/judgement.py).
* mover: a track that moves by the verdict, or has some evidence of motion.
* suspect: a mover that was cut out of another track and has yet to prove that it moves.
* surface: the cells of one track in one frame, the visible side of its body.
* free rim of a surface: where it ends in front of something farther, so that the end is its own outline
  (vision/depth/rims.py).
* arrived cell: its surface is in space that was seen free a moment ago (vision/bodies/arrivals.py).
* residual of an end: how far it is seen from where it would be if it were static
  (vision/motion/residuals.py).
* evidence of a track: support for its motion, by the residuals of its fragments, by arrivals and by its
  surface. MotionEvidence is that of one frame; judgement adds it up over frames to a score.
* own part: a part of the robot in its camera's view, cut out of the depth (vision/camera/own_parts.py); own
  cell: a cell that shows one.
* region: measures of a labelled set of cells (a part or a surface): box, centre, extent, whether it is cut.
* line of sight: from the camera to a body. Motion along it is measured by depth and by changes of length,
  motion across it by the image.
* near and far surface of an end: at a silhouette the pixels around it lie on two surfaces
  (vision/depth/depth_mask.py).
* sweep: how far the camera turned while the rows of one image were read
  (vision/ego_motion/rolling_shutter.py).
"""
