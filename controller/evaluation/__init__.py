"""The paper's evaluation, reproduced and extended: sequences with truth, scores, baselines, report."""
