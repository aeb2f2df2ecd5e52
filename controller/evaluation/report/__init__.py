"""The report: all figures in one summary, then the text, the diagrams and the camera images.

The files in the order in which they come into play:

* summary.py - all figures of the simulated set, as JSON
* targets.py - what the detector has to reach
* paper.py - what the paper reports
* markdown.py - tables, sections and numbers of a report; the campaign's too
* simulated_part.py - the text on the simulated set
* recordings_part.py - the text and the pictures on recordings
* chart.py, figures.py - the diagrams
* pictures.py - the camera images
* folder.py - writes the report folder
"""
