"""Gains along the truth that samples share, in compiled code, against those of the linear engine."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.linear.engine.adjoint import adjoint
from mcnav.systems.ins.ensemble.gains import SharedGains
from tests.cross.test_ins_adjoint import ALL, ROUNDING
from tests.cross.test_ins_aided import engine


@pytest.mark.parametrize("sensors", [("gnss",), ALL])
def test_gains_covariances_and_rows_of_both_are_the_same(sensors: tuple[str, ...]) -> None:
    """To 1e-11 of the largest of each state, as rounding of some hundred updates leaves them."""
    tables = engine(sensors=sensors).tables
    loop, epochs = tables.loop, tables.ensemble.epochs
    shared = SharedGains.along(loop, epochs)
    designed = loop.designed(loop.positions(epochs, np.ones(len(epochs))))
    scale = np.sqrt(np.diagonal(designed.covariances, axis1=1, axis2=2)).max(axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    within = np.arange(designed.roots.shape[1]) < loop.measurements.sizes[:, None]
    roots = np.diagonal(designed.roots, axis1=1, axis2=2)  # as large as an innovation
    assert np.abs((shared.covariances - designed.covariances) / np.outer(scale, scale)).max() < ROUNDING
    assert np.abs((shared.gains - designed.gains) * roots[:, None] / scale[:, None]).max() < ROUNDING
    assert (np.abs(shared.roots - designed.roots) * within[:, :, None]).max() < ROUNDING * roots.max()
    # rows of the outputs at the last epoch, of what is added in a step and of what the start is
    end = int(loop.positions(epochs[-1:], np.ones(1))[0])
    outputs = loop.timeline.readout(end, float(loop.times[epochs[-1]]))
    rows = adjoint(loop.timeline, designed.gains, end, outputs)
    size = np.abs(rows[:, :, :9]).max(axis=(0, 2))
    assert (np.abs(tables.adjoint.start[:, :9] - rows[0, :, :9]).max(axis=1) / size).max() < ROUNDING
    behind = loop.positions(np.arange(epochs[-1]), np.ones(epochs[-1])) + 1
    assert (np.abs(tables.adjoint.steps[: epochs[-1]] - rows[behind, :, :9]).max(axis=(0, 2)) / size).max() < ROUNDING
