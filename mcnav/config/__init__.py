"""Campaign files: read, checked and resolved to a `Campaign`."""
