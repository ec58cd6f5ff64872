"""Linear covariance analysis: partial derivatives by three methods, P S P^T, and corrections to it."""
