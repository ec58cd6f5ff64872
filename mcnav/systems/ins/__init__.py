"""Inertial navigation in three dimensions on a rotating, oblate earth."""
