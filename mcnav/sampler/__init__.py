"""Statistics of the error sources (distributions, correlations, start covariance) and their samples."""
