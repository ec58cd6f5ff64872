"""The example at the top of the README, its text and its picture from one run: ``python -m tests.readme RUN``.

`make examples` makes the run of campaign 20 in ``build/examples`` and calls this.
"""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from mcnav.store.run_folder import RunFolder
from mcnav.units import conversion
from mcnav.workflow.figure import draw_figure
from mcnav.workflow.stored_summary import summary_of
from tests.commands import invoke

ROOT: Final = Path(__file__).parent.parent
CAMPAIGN: Final = "campaigns/20_flight_with_neglected_errors.toml"
PICTURE: Final = "reports/examples/filter.png"
BEGIN: Final = "<!-- example: written by make examples -->\n"
END: Final = "<!-- end of example -->\n"

TABLE: Final = "Filter: true over filter sigma of each output"
ROWS: Final = ("output ", "position north", "position down", "tilt north", "tilt east", "heading")
"""Rows of that table of `mcnav show` that are printed."""

SIZE: Final = (17.0, 6.6)
"""Width and height of the picture, cm."""

TEXT: Final = """\
An hour of flight with GNSS. The filter estimates the biases of its sensors, and leaves out their misalignments and
scale factors: `mcnav run {campaign}`

{table}

{sentence}

![True sigma over the filter's own, over the hour: position up to fourfold, tilt more than tenfold]({picture})

*True sigma ÷ filter sigma. A consistent filter stays at 1. Points: {samples:,} simulated samples with intervals;
dashed: linear covariance analysis, no simulation.*
"""


def excerpt(folder: Path) -> str:
    """Write the example of a run."""
    summary = summary_of(folder)
    table = textwrap.indent("\n".join(printed_rows(invoke("show", folder, cwd=ROOT).stdout)), "    ")
    filled = TEXT.format(
        campaign=CAMPAIGN, table=table, sentence=textwrap.fill(sentence(folder, summary), 120),
        picture=PICTURE, samples=summary["samples"],
    )  # fmt: skip
    return filled


def printed_rows(shown: str) -> list[str]:
    """Take the rows of the filter's table from what `mcnav show` prints."""
    _, _, after = shown.partition(f"{TABLE}\n")
    return [line for line in after.partition("\n\n")[0].splitlines() if line.startswith(ROWS)]


def sentence(folder: Path, summary: Mapping[str, Any]) -> str:
    """Say what the filter states where its own sigma is farthest from the true one, what is true, and why."""
    found = summary["filter"]
    stored = RunFolder(folder).epochs()
    if found["verdict"] != "optimistic" or stored is None:
        raise ValueError(f"{folder}: holds no run with an optimistic filter, which the README leads with")
    columns, _ = stored
    angles = {name: entry for name, entry in found["outputs"].items() if entry["unit"] == "rad"}
    name = max(angles, key=lambda each: float(angles[each]["factor"]))
    time = angles[name]["worst"]
    place = int(np.argmin(np.abs(columns["time [min]"] - time)))
    to_shown = conversion("rad", "mrad")
    true, own = (columns[f"{kind} {name} [rad]"][place] * to_shown for kind in ("sigma", "filter sigma"))
    cause = found["neglected"][0]["name"].replace("_", " ")
    (sensor,) = found["sensors"].values()
    return (
        f"After {time:.0f} minutes the filter claims to know the {name.replace('_', ' ')} to {own:.3f} mrad (1σ). The "
        f"truth is {true:.3f} mrad, {true / own:.0f} times as much. The largest unmodelled error is {cause}. NIS "
        f"hardly shows it: its mean is {sensor['nis_mean']:.1f}, where {sensor['size']} is expected."
    )


def renewed(text: str, example: str) -> str:
    """Make the README with another example; `ValueError` when its marks are not there."""
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise ValueError(f"the README lacks its marks {BEGIN.strip()} and {END.strip()}")
    return f"{before}{BEGIN}\n{example}\n{END}{after}"


def main(folder: Path) -> None:
    """Write the example into the README, and draw its picture."""
    readme = ROOT / "README.md"
    readme.write_text(renewed(readme.read_text(encoding="utf-8"), excerpt(folder)), encoding="utf-8")
    draw_figure(folder, "sigma_history", ROOT / PICTURE, *SIZE, 1.0, ("position", "tilt and heading"))


if __name__ == "__main__":
    main(Path(sys.argv[1]).absolute())
