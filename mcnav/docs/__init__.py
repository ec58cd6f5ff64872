"""Pages of the documentation, and their names."""
