"""Moments, intervals and tests on plain arrays."""
