"""Mutation trials are no tests."""

collect_ignore_glob = ["*"]
