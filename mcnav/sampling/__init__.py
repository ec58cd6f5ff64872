"""Error sources as statistics (distributions, correlations, start covariance) and as draws."""
