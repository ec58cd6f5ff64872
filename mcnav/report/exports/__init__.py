"""Results as files: rows, arrays, data sets."""
