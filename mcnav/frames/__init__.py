"""The four functions of a covariance analysis in Python, on labelled frames: draw, simulate, linearise, compare.

===============  =========================================================  ====================
word             function                                                   room below
===============  =========================================================  ====================
sampler          `Errors.draw` in `mcnav.sampler.errors`                    `mcnav.sampler`
runner           `simulate` in `mcnav.frames.simulation`                    `mcnav.runner`
partials         `partials` in `mcnav.frames.linear`                        `mcnav.systems`
P S P'           `propagate_covariance` in `mcnav.frames.linear`            `mcnav.linear`
analysis         `compare` in `mcnav.frames.comparison`                     `mcnav.analysis`
all of it        `run` in `mcnav.frames.runs`                               `mcnav.workflow`
===============  =========================================================  ====================

Rows and columns are named after error sources and outputs. Values are in SI units and radians; the units are in
``frame.attrs["units"]``.
"""
