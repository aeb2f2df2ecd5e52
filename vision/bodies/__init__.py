"""Obstacles: connected parts of the view become tracks with id, velocity and verdict (moving or static).

Files, in the order in which they come into play within one frame (vision/tracker.py calls them):

* tracks - the state of all tracks that is kept from frame to frame.
* arrivals - which surfaces have arrived in space that was seen free, and which have stayed.
* masks - where the cells of each track are predicted in this frame.
* votes - the predicted cells vote to which track each connected part belongs.
* grouping - parts are attached to tracks or detached from them where connected depth says too little.
* births - new tracks for large parts that no track claims.
* carving - suspects: possible movers, to be cut out of a larger track.
* ends - the cells close to the end points of fragments; used by carving.
* left_behind - furniture that a mover has left, to be parted from its track.
* cutting - what these two have found becomes tracks of its own.
* grounding - a mover is extended down to the floor.
* regrouping - tracks are joined and divided, by these two:
* merging - two tracks that are one body are joined.
* division - one track that holds two bodies is divided.
* boxes - geometry of boxes; used by grouping, merging and report.
* sizes - how large a person is, and other thresholds of several steps.
* sightings - the Kalman filters are updated by the centroids of the visible surfaces.
* rim_motion - the speed of half hidden bodies by their free rims.
* approach - the speed of such bodies towards the camera by the depth of their surface then and now.
* hanging - which tracks hang above the robot.
* adoption - each fragment is assigned to a track.
* motion_evidence - all evidence of one frame, for the verdict.
* proof - what one frame proves of each track: moving, standing still or neither.
* proof_rules - the rules for that, one function each.
* judgement - the proofs are added up over frames to a verdict with hysteresis.
* report - tracks and fragments are written into the Scene.
* few_fragments - bodies at which the next frame looks more closely.
"""
