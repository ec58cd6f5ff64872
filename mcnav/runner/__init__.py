"""Chunks of samples: drawn, simulated and stored by workers."""
