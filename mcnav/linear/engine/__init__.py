"""The linear engine: answers every linear question about a timeline (`mcnav.contract.timeline`), in numpy.

`design` computes gains and the filter's own covariance, `propagate` partial derivatives and covariances, `adjoint` rows
of the outputs at every position, `start_times` the end for many starts, `smooth` what a smoother leaves, and
`innovation_laws` innovations together with the errors after their updates.
"""
