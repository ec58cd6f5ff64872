"""Inertial instruments: their errors, and the noise of samples."""
