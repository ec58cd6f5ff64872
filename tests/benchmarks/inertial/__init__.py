"""Inertial navigation in three dimensions: the chapter of its own in the benchmarks.

The same flight, instruments and updates through mcnav's engines and its peers; free and aided hours; whole runs;
growth; what bounds the kernels. ``python -m tests.benchmarks --only inertial`` measures it and writes its record and
the page.
"""
