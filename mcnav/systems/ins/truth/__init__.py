"""The true flight: trajectories from files, segments, reentries and boosts."""
