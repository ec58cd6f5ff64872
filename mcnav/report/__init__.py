"""Presentation of a run: HTML pages, tables and sentences for the terminal, and files; nothing is computed here."""
