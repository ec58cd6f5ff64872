"""Arrays in, judgements out: comparison of linear and Monte Carlo dispersion, verdicts, error budget."""
