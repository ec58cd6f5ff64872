"""Moments, intervals and tests on plain arrays; nothing here knows of navigation."""
