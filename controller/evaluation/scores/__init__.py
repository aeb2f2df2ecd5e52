"""Scores: what a method answered against the truth.

The files in the order in which they come into play:

* matching.py - which detection is which true object
* scoring.py - scores of one method on one sequence
* pixels.py - scores at pixel level
* endpoint_error.py - errors of the tracked fragments
* totals.py - the scores of many sequences as one set of figures
"""
