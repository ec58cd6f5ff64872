"""Reproduction of The Story of 84 Minutes (W. Bollay, 1966)."""
