"""Gallery: a picture of every example with its question and answer.

`python .github/site/gallery.py` draws the pictures. They are of linear covariance, which simulates nothing, as
`mcnav lincov` draws it, and are kept in the folder static/gallery, so that the site is built without computing.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Final

HERE: Final = Path(__file__).resolve().parent
ROOT: Final = HERE.parent.parent
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))

if TYPE_CHECKING:
    from mcnav.report.drawing.figure import Figure

PICTURES: Final = HERE / "static" / "gallery"
REPORTS: Final = Path("reports") / "examples"

WIDTH, HEIGHT, FONT = 9.0, 5.6, 0.8
"""Size of a picture, cm, and of its text over that of the page."""

ASKED: Final = {"21_flight_with_an_altimeter": "position down", "38_hover_with_an_altimeter": "position down"}
"""Outputs that examples ask about, where that is not the first."""

HEAD: Final = """# Gallery

Every example with its question and the expected answer. A picture shows the linear 1σ of one output over time, or,
where it is known at the end alone, the share of each cause in the variance of the outputs; with a filter also what it
states. It leads to the example; `mcnav demo NUMBER` runs it, and its report shows the same with Monte Carlo beside it.
"""


def picture_of(campaign: Path) -> Figure | None:
    """Return the figure that stands for a campaign: an output over time, else the error budget."""
    from mcnav.report.figures import lincov as drawn
    from mcnav.studies.lincov import linear_covariance

    answer = linear_covariance(campaign)
    over_time = drawn.sigmas(answer, {})
    if over_time is None:
        return drawn.budget(answer)
    return over_time.of_panels(ASKED.get(campaign.stem, over_time.panels[0].title))


def draw(campaign: Path, folder: Path) -> Path:
    """Write the picture of a campaign; the same campaign gives the same bytes."""
    figure = picture_of(campaign)
    if figure is None:
        raise ValueError(f"{campaign}: linear covariance has no figure")
    written = folder / f"{campaign.stem}.svg"
    figure.save(written, width=WIDTH, height=HEIGHT, font_scale=FONT)
    return written


def page() -> str:
    """Write the page."""
    from escaping import escape

    from mcnav.entries.examples import question_and_answer

    parts = [HEAD]
    for file in sorted((ROOT / "campaigns").glob("*.toml")):
        question, answer = question_and_answer(file.read_text(encoding="utf-8"))
        anchor = file.stem.replace("_", "-")
        question, answer = (each[:1].upper() + each[1:] for each in (question, answer))
        report = REPORTS / file.stem / "report.html"
        links = [f"[campaign](/reference/examples.md#{anchor})"]
        links += [f"[report](/{report.as_posix()})"] if (ROOT / report).exists() else []
        picture = f"/static/gallery/{file.stem}.svg"
        shown = f"[![Linear analysis of {file.stem}]({picture})](/reference/examples.md#{anchor})"
        parts += [f"## {file.stem}", shown, f"**{escape(question)}**", escape(answer), " · ".join(links)]
    return "\n\n".join(parts) + "\n"


def attached() -> set[str]:
    """Return the files that the page links to."""
    return {path.relative_to(ROOT).as_posix() for path in (ROOT / REPORTS).glob("*/report.html")}


if __name__ == "__main__":
    PICTURES.mkdir(parents=True, exist_ok=True)
    for campaign in sorted((ROOT / "campaigns").glob("*.toml")):
        print(f"written: {draw(campaign, PICTURES).relative_to(ROOT)}", flush=True)
