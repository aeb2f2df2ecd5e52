"""Small arrays: filters, medians."""
