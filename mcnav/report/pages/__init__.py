"""Pages: one module for a kind of page, a folder for that of a run."""
