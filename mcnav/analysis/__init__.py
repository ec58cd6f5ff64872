"""Analysis of arrays: comparison of linear and Monte Carlo dispersion, verdicts, error budget."""
