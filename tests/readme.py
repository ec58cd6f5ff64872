"""The example at the top of the README, its text and its picture from one run: ``python -m tests.readme RUN``.

`make examples` makes the run of the demonstration in ``build/examples`` and calls this.
"""

from __future__ import annotations

import sys
import textwrap
from pathlib import Path
from typing import Final

from mcnav.report.document.fitted_table import OpenConsole
from mcnav.report.terminal.answer_screen import WIDTH, screen
from mcnav.store.run_folder import RunFolder
from mcnav.workflow.figure import draw_figure
from mcnav.workflow.stored_summary import stored_summary

ROOT: Final = Path(__file__).parent.parent
CAMPAIGN: Final = "campaigns/01_tn_d1772_trajectory_4.toml"
PICTURE: Final = "reports/examples/demo.png"
BEGIN: Final = "<!-- example: written by make examples -->\n"
END: Final = "<!-- end of example -->\n"

SIZE: Final = (17.0, 6.6)
"""Width and height of the picture, cm."""

TEXT: Final = """\
{screen}

![A histogram wider than the linear Gaussian, and samples that bend out of the linear ellipses]({picture})

*The fifth row, drawn: along the thinnest direction of the linear ellipsoid the samples bend away, and spread more.*
"""


def excerpt(folder: Path) -> str:
    """Write the example of a run: what `mcnav demo` prints, less its last lines, and the picture."""
    console = OpenConsole(width=WIDTH, soft_wrap=True, color_system=None)
    execution = RunFolder(folder).finished_manifest().execution
    with console.capture() as captured:
        console.print(screen(stored_summary(folder), {}, execution.seconds if execution else None, ()))
    return TEXT.format(screen=textwrap.indent(captured.get().rstrip(), "    "), picture=PICTURE)


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
    draw_figure(folder, "combination", ROOT / PICTURE, *SIZE, 1.0)


if __name__ == "__main__":
    main(Path(sys.argv[1]).absolute())
