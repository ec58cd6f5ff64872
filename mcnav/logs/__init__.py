"""Recorded data: tables of any format, records of inertial sensors, tracks."""
