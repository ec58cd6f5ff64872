"""Types of arrays, and products of covariances."""
