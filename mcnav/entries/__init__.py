"""Entries of campaign files: the file and its mistakes, quantities, sizes by axis, files that it names."""
