"""Identification of an instrument's noise from a static record: likelihood, intervals, test of fit."""
