"""How the camera moved: a prior, the anchored ends that stand still, and rows read one after another."""
