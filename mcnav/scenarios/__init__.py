"""Scenarios: systems with named error sources and named outputs."""
