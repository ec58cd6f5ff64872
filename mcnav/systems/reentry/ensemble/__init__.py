"""The ensemble engine of reentry: shared tables, kernels, refinement."""
