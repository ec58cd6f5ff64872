"""Sections of the report of a run: a module for the parts of a section or two."""
