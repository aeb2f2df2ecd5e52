"""One runnable representative of each category of the paper's Table 1, and dense flow beside them."""
