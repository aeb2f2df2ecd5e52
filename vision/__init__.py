"""RgbdFrame -> Scene: the featured-fragment detector of Daeef 2020 and what it needs to be safe.

vision/detector.py turns a frame into a Detection, vision/tracker.py turns that into a Scene. Their terms:

* fragment: a short line segment in the image, followed from frame to frame; end: one of its two end points.
* anchor of an end: where that end was, and how deep, some frames ago, in the fixed frame.
* fixed frame: the coordinate frame in which the detector keeps the camera's pose and the tracker its tracks.
* cell: one element of the coarse depth grid (vision/depth/depth_grid.py); it stands for a few pixels each
  way.
* part: cells of one frame that are connected without a jump in depth (vision/depth/connected.py). Parts have
  no past.
* body: a physical thing, a person or a vehicle for example. Depth may merge two bodies or split one.
* track: what is kept of one body from frame to frame: id, filter, verdict (vision/bodies/tracks.py). Comments
  on slip and vibration, however, mean the crawler tracks that the robot drives on.
* mover: a track that moves by the verdict, or has some evidence of it; suspect: a track that was cut
  out of another one and has yet to prove that it moves.
* surface: the cells of one track in one frame, the visible side of its body.
* residual of an end: by how much it is not seen where it would be if it were static
  (vision/motion/evidence.py).
* evidence of a track: what speaks for its motion, from the residuals of its fragments, from arrivals and from
  its surface: in one frame (MotionEvidence), and added up over frames to a score
  (vision/bodies/judgement.py).
* region: what a labelled set of cells (a part or a surface) measures: box, centre, extent, whether it is cut.
"""
