"""How fast, how accurate, how large: this program beside its peers, on the same draws, and as its runs grow.

``python -m tests.benchmarks`` (`make bench`) measures and writes `reports/benchmarks/`. Every peer flies the navigator
of NASA TN D-1772 along the same truth and is a module of `tests.benchmarks.peers`; what they are given is a `Case`,
what they give are the final navigation errors of draws. Of all this only `tests/unit/test_benchmarks.py` belongs to the
test suite.
"""
