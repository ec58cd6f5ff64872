"""Validation of the statistics: measured coverage, false alarms and power on systems with known moments."""
