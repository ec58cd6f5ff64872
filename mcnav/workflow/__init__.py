"""The way of the data, one use case a file."""
