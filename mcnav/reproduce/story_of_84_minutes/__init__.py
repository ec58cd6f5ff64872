"""The Story of 84 Minutes recomputed."""
