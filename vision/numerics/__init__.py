"""Small arrays: filters, medians, inverses."""
