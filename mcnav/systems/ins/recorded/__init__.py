"""The aided navigator on recorded readings and measurements, and recordings made of simulated samples."""
