"""The guided reentry for thousands of samples: Taylor series in cartesian inertial axes."""
