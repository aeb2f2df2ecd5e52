"""Small arrays: filters, medians, transforms."""
