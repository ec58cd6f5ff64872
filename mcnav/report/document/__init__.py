"""A page as data, and how it is written: HTML, terminal, PDF."""
