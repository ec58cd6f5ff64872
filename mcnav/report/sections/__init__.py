"""The report of a run: one module for the parts of a section or two, as `mcnav.report.document` describes pages."""
