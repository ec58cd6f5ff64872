"""Linear covariance analysis: partial derivatives three ways, P S P^T, and the unscented transform beside it."""
