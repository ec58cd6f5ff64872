"""Units and constants."""
