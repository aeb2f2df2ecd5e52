"""Camera baselines: one runnable representative of each category of the paper's Table 1, and dense flow.

The files in the order in which they come into play:

* background_model.py - background modelling (first row of the table)
* trajectories.py - trajectory classification (second row)
* box_tracking.py - object tracking (third row)
* low_rank.py - low rank and sparse representation (fourth row)
* dense_flow.py - dense flow minus rigid flow (not in the table)
* ego_motion.py - the camera's ego-motion, for those above
* masks.py - half-size images; from a mask to detections with track ids
"""
