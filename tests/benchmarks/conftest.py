"""Benchmarks are no tests, and import what a test environment does not have."""

collect_ignore_glob = ["*"]
