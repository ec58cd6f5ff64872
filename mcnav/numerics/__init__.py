"""Numerical methods that several systems use: integrators, dense output, grid refinement, sums of powers."""
