"""Featured fragments: line segments in the image, tracked from frame to frame and renewed.

Files, in the order in which they come into play within one frame:

* store - the fragments with their history; gives the anchors.
* optical_flow - the end points are tracked into the new image.
* lucas_kanade - the search for points in one level of the pyramid.
* renewal - new fragments are searched where they have become few.
* edges - Canny edges.
* contours - runs of edge pixels, cut into pieces.
* segments - line segments from edges, with their ends moved to corners.
* candidates - segments become new fragments: trackable ends, depth on one surface.
* corners - pairs of corners, for bodies without straight edges.
* attention - bodies with too few fragments (vision/bodies/few_fragments.py) are searched by themselves.
"""
