"""Cruise and hover of "The Story of 84 Minutes"."""
