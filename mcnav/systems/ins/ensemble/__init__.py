"""The ensemble engine: deviations of many samples from the shared truth, and their filters, in vectors of lanes."""
