"""Reentry of NASA TN D-1772: truth, instruments, navigator, linearized equations."""
