"""Linear analysis: responses along the truth, covariances with noise, the closed loop of navigator and filter."""
