"""What of a flight is stored beside its samples: outages of aiding, and the first samples' histories."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mcnav.contract.history import Epochs, History
from mcnav.contract.quantities import Output
from mcnav.errors import RunFolderError
from mcnav.store.histories import histories_table
from mcnav.store.run_files import HISTORIES, HISTORY
from mcnav.store.run_folder import RunFolder, history_table
from mcnav.systems.histories import check_history

EPOCHS = Epochs("time [min]", np.array([0.0, 1.0, 2.5]))
OUTPUTS = (Output("position", "m", "km"), Output("heading", "rad", "mrad"))


@pytest.mark.parametrize("count", [1, 3, 5, 9])
def test_the_first_histories(tmp_path: Path, count: int) -> None:
    """As many as are asked for, or as there are; failed samples are NaN."""
    histories = np.random.default_rng(1).standard_normal((5, 3, 2))
    histories[1] = np.nan
    (tmp_path / HISTORIES).write_bytes(histories_table(EPOCHS, OUTPUTS, histories))
    found = RunFolder(tmp_path).histories(count)
    assert found is not None
    label, times, errors = found
    assert label == EPOCHS.label
    np.testing.assert_array_equal(times, EPOCHS.times)
    assert list(errors) == ["position [m]", "heading [rad]"]
    np.testing.assert_array_equal(np.stack(list(errors.values()), axis=2), histories[:count])


def test_no_histories_and_damaged_ones(tmp_path: Path) -> None:
    assert RunFolder(tmp_path).histories(3) is None
    for content in (b"", b"not a table", histories_table(EPOCHS, OUTPUTS, np.empty((0, 3, 2)))):
        (tmp_path / HISTORIES).write_bytes(content)
        with pytest.raises(RunFolderError, match="is damaged"):
            RunFolder(tmp_path).histories(3)


def test_histories_of_other_outputs_are_not_read(tmp_path: Path) -> None:
    """A small file may claim to have thousands of columns."""
    (tmp_path / HISTORIES).write_bytes(histories_table(EPOCHS, OUTPUTS, np.zeros((5, 3, 2))))
    assert RunFolder(tmp_path).histories(3, ["position [m]", "heading [rad]"]) is not None
    for expected in (["position [m]"], ["heading [rad]", "position [m]"], []):
        with pytest.raises(RunFolderError, match="is damaged"):
            RunFolder(tmp_path).histories(3, expected)


def test_outages_of_a_history() -> None:
    history = check_history(History({"time [s]": np.arange(3.0)}, outages={"gnss": ((0, 1), (2, 2))}))
    assert history.outages == {"gnss": ((0.0, 1.0), (2.0, 2.0))}
    with pytest.raises(ValueError, match="before it begins"):
        check_history(History(outages={"gnss": ((2.0, 1.0),)}))
    with pytest.raises(ValueError, match="unpack"):
        check_history(History(outages={"gnss": ((2.0, 1.0, 3.0),)}))  # type: ignore[dict-item]


def test_outages_are_stored(tmp_path: Path) -> None:
    """A history without any is stored as it was before there were outages."""
    files = []
    for outages in ({}, {"gnss": ((0.5, 1.0),)}):
        folder = RunFolder(tmp_path / str(len(outages)))
        history = History({"time [s]": np.arange(3.0)}, {"end": 2.0}, outages=outages)
        folder.write(HISTORY, history_table(history))
        assert folder.history().outages == outages
        files.append((folder.path / HISTORY).read_bytes())
    assert b"mcnav.outages" not in files[0]
    assert b"mcnav.outages" in files[1]


def test_the_title_of_a_history_is_stored(tmp_path: Path) -> None:
    for title in ("Nominal flight", "Errors left by one error alone"):
        folder = RunFolder(tmp_path / title)
        folder.write(HISTORY, history_table(History({"time [s]": np.arange(3.0)}, {}, title=title)))
        assert folder.history().title == title
