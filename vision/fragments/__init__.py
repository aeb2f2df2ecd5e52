"""Featured fragments in the image: edges, contours, segments, followed from frame to frame and renewed."""
