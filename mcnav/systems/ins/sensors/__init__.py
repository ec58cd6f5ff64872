"""Aiding sensors: what they measure, and their errors."""
