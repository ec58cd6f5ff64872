"""Results that are kept: in memory while a process runs, and in a folder between commands."""
