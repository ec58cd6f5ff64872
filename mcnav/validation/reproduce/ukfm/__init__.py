"""The benchmark of ukfm, five filters of an inertial navigator that sees landmarks, simulated again."""
