"""Campaigns: the file that describes one, the folder that holds its run, and the runner that fills it."""
