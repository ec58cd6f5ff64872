"""Probabilities of rare events: flights along lines that the linear model chooses, and a search for what it misses."""
