"""Publications recomputed, and measured error rates of the statistics. No other room imports it."""
