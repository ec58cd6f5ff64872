"""Validation of the statistics: measured coverage, false alarms and power on systems with known moments.

``python -m tests.calibration`` (`make calibrate`) measures all rates and writes ``reports/calibration``. The study is
no part of the test suite; its tests are in ``tests/statistical``.
"""
