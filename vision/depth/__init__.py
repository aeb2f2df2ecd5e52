"""Depth without fragments: a coarse grid, the parts of the view that stand out, free space."""
