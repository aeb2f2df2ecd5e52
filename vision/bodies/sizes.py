"""What the size of a body tells, and what is in front of it: thresholds that several steps have in common.

How wide one person is decides what is cut out of a track, what is joined and what is divided.
"""

SINGLE_WIDTH_M = 0.85  # no single person is wider
# Gate on depth for what may be of one body: its depth, plus this many sigmas of the noise of depth.
SAME_BODY_M, SAME_BODY_SIGMAS = 0.3, 2.0
NEARER_INVERSE = 0.02  # 1/m: something is in front of a body if its inverse depth is larger by this
# A group of cells is seen through another one if this share of it is within the other's box.
SEEN_THROUGH_SHARE = 0.9
# A group seen through another one is at most this share as tall; a person behind it is taller.
SEEN_THROUGH_HEIGHT = 0.5
