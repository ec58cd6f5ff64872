"""Validation of the statistics as an HTML page with figures of measured and nominal rates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from markupsafe import Markup

from mcnav.files.whole import write_texts
from mcnav.report.document.html import page_html
from mcnav.report.document.parts import Folded, Note, Page, Section, Sentence
from mcnav.report.document.table import Cell, Column, Table, counted, label
from mcnav.report.drawing.figure import HALF, Figure
from mcnav.report.drawing.marks import Axis, Mark, Panel, Points, Rule, Series
from mcnav.report.drawing.palette import FLOWN, INK, LINEAR, MUTED
from mcnav.sampler.designs import DESIGNS
from tests.calibration.cells import Tally
from tests.calibration.filter_trials import FILTER, run_filter_trials
from tests.calibration.identification_trials import IDENTIFY, run_identification_trials
from tests.calibration.identification_trials import SHARE as RECORDS_SHARE
from tests.calibration.kalman_trials import KALMAN, run_kalman_trials
from tests.calibration.named_trials import CSV as JUDGE_CSV
from tests.calibration.named_trials import JUDGE, count, measure
from tests.calibration.navigation_trials import AIDED, NAVIGATION, SHARE, run_navigation_trials
from tests.calibration.noise_trials import NOISE, run_noise_trials
from tests.calibration.rare_trials import CSV as RARE_CSV
from tests.calibration.rare_trials import RARE, run_rare_trials
from tests.calibration.slow_trials import run_slow_trials
from tests.calibration.table import rates
from tests.calibration.tail_trials import TAILS, run_tail_trials
from tests.calibration.trials import run_trials

if TYPE_CHECKING:
    import pandas as pd

TITLES: Final = {
    ("", "coverage"): "Coverage of intervals",
    ("", "false alarm"): "False alarms of tests",
    ("", "power"): "Power against a linear model that is 5 % wrong",
    ("noise", "coverage"): "Noise: coverage of intervals",
    ("noise", "false alarm"): "Noise: false alarms",
    ("noise", "power"): "Noise: power",
    ("tails", "coverage"): "Requirements: coverage of bounds",
    ("tails", "power"): "Requirements: power over twelve epochs",
    ("filter", "coverage"): "Filters: coverage of intervals",
    ("filter", "false alarm"): "Filters: false alarms",
    ("filter", "power"): "Filters: power, and naming of the largest neglected error",
    ("rare", "coverage"): "Rare events: coverage of intervals",
    ("rare", "power"): "Rare events: finding of a second way to fail",
    ("identify", "coverage"): "Identification: coverage of intervals",
    ("identify", "false alarm"): "Identification: false alarms",
    ("identify", "power"): "Identification: what is identified, and what is noticed",
    ("judge", "coverage"): "Judged records: coverage of intervals",
    ("judge", "false alarm"): "Judged records: false alarms",
    ("judge", "power"): "Judged records: what is wrong is named",
}
"""Titles of the sections by group of systems and kind of rate."""

GROUPS: Final = {
    NOISE: "noise", NAVIGATION: "noise", TAILS: "tails", FILTER: "filter", KALMAN: "filter", AIDED: "filter",
    IDENTIFY: "identify", RARE: "rare", JUDGE: "judge",
}  # fmt: skip
"""Groups of systems by the beginnings of their names."""

CSV: Final = "calibration.csv"

ALONE: Final = ("rare", "judge", "processes")
"""Rates that may be measured alone: of rare events, of judged records, of slow processes in static records."""

JUDGED_SHARE: Final = 2.5
"""Campaigns of other kinds for which there is one judged record with each wrong thing."""

FINDINGS: Final = {
    "as stated": ("agrees", "", "the nominal rate is within the binomial interval (99.9 %)"),
    "safe": ("agrees", "+", "outside, on the conservative side"),
    "nearly": ("undecided", "≈", "outside by less than 0.01"),
    "remarked": ("undecided", "*", "outside by more; the report of such a campaign warns of it (long tails)"),
    "off": ("differs", "≠", "outside by more, without a warning"),
    "withheld": ("", "†", "not reported by the program, because the rate is too far off"),
}
"""Tone, sign and meaning of each finding."""

MARKS: Final = {
    "as stated": Series("stated", "as stated", LINEAR, "dot"),
    "safe": Series("safe", "safe", LINEAR, "triangle"),
    "nearly": Series("nearly", "nearly", INK, "box"),
    "remarked": Series("remarked", "remarked", INK, "onward"),
    "off": Series("off", "off", FLOWN, "square"),
    "withheld": Series("withheld", "withheld", MUTED, "ring"),
    "": Series("power", "rate", LINEAR, "dot"),
}
"""Marks of each finding; a power has no finding."""


SYSTEMS: Final = Markup(
    "Systems: <em>linear</em>, the simulation is the linear model; <em>disguised</em>, nonlinear with exactly the"
    " linear mean and covariance; <em>quadratic</em>, y₁ = x₁ + 0.2 x₂², y₂ = x₁/2 + x₃ + 0.2 x₁x₂; "
    "<em>corrupted</em>, the first column of the linear model is 5 % too large; <em>dependent</em>, y₁ = x₁, y₂ ="
    " 2 x₁, of which y₂ − 2 y₁ has no dispersion; <em>bent</em>, y₂ = 2 x₁ + 0.001 (x₁² − 1), of which it has "
    "some. For Student's t with five degrees of freedom the program reports no intervals. With ten degrees of "
    "freedom it reports none for antithetic pairs and Sobol nets, and approximate ones with a warning for the "
    "other designs."
)
"""Descriptions of the systems."""

OTHERS: Final[Mapping[str, tuple[Markup, ...]]] = {
    "noise": (
        Markup(
            "Noise: as these systems, with two processes of noise; each sample has a linear outcome with the same "
            "noise. <em>At the tolerance</em>, sigmas are larger than the linear ones by just the tolerance of 5 %, "
            "so that they neither agree nor differ; <em>response wrong</em>, the linear model's response to noise is "
            "5 % too large, in its outcomes as in its covariance; <em>covariance wrong</em>, in its covariance alone; "
            "<em>twins</em>, two runs of quadratic systems are compared. Linear outcomes are doubted with a "
            "probability of one in a million where they are right. <em>Free navigation</em>: seven minutes of "
            "inertial navigation with biases and random walks, simulated and analysed as a run is."
        ),
    ),
    "tails": (
        Markup(
            "Requirements: three outputs of three sources and noise at twelve epochs; <em>errors rising</em>, sigmas "
            "grow threefold; <em>errors steady</em>, the covariance is the same at all epochs. Bounds by order "
            "statistics are conservative, because ranks are whole numbers; lower bounds over several epochs, because "
            "they hold at all of them."
        ),
    ),
    "filter": (
        Markup(
            "Filters: nine normal errors at 61 epochs, correlated by 0.9 from epoch to epoch, and a filter that "
            "states one fixed covariance; <em>matched</em>, it is that of the errors; <em>at the tolerance</em>, all "
            "errors are larger by just 5 %, the tolerance; <em>one error at the tolerance</em>, one of the nine is; "
            "<em>one error at 10 %</em>, one is larger by just 10 %, and this is the tolerance of some statements; "
            "<em>20 % optimistic</em>, the position errors are larger by 20 %; <em>one error 20 % larger</em>, one of "
            "the nine is; <em>two errors that cancel</em>, another one of the same group is smaller, so that the mean "
            "NEES is as expected; <em>one axis</em>, one position error is twice as large. The rates of departures "
            "that are found by mistake are below the nominal 5 %, because intervals of neighbouring epochs are not "
            "independent, and because a departure must be beyond the tolerance."
        ),
        Markup(
            "Kalman filters: position, velocity and a constant bias along three axes, sixty fixes, in closed loop; "
            "<em>matched</em>, the filter estimates the bias; <em>considering</em>, it considers the bias without "
            "estimating it; <em>biases neglected</em>, it knows nothing of biases, of which one is larger by 3 %; "
            "<em>fixed bias</em>, nothing of a bias that is the same in all samples. The largest neglected error is "
            "named by linear analysis. <em>Aided navigation</em>: the same flight as <em>free navigation</em>, with "
            "GNSS; <em>considering</em>, the filter considers a bias of its velocity."
        ),
    ),
    "rare": (
        Markup(
            "Rare events: functions of standard normals whose probabilities, from 1e-7 to 1e-4, are known exactly. "
            "The linear model is one normal alone. It has no curvature, no jump, no second way to fail and no outside "
            "of a ball. <em>Random</em> events have directions, limits and probabilities of their own for each "
            "seed. Each is estimated by lines, levels and widened errors. With <em>noise</em>, normals that no "
            "simulation chooses, and with <em>few flights</em>, some thousand samples of lines and widened errors are "
            "all there is. Refused estimates count as not called met. The file rare_events.csv has every run."
        ),
    ),
    "identify": (
        Markup(
            "Identification: a day of readings at rest, one a second, of each grade of the catalogue: white noise and "
            "a Gauss-Markov process. Intervals are those of values that a record identifies, in the chosen model. "
            "Quantization, which no grade has, is taken in where it improves −2 log L by four. <em>Drift</em>: a "
            "temperature that rises by 1 °C in an hour, with a tenth of the grade's bias for each °C; <em>line</em>, a "
            "vibration at 0.1 Hz of 5 % of the white noise's sigma in a reading; <em>quantization</em>, steps of twice "
            "this sigma in the accumulated value; <em>stuck</em>, a hundredth of the readings stand still. "
            "<em>Flicker, walk, Gauss-Markov</em> and their pairs: 8,192 readings of white noise and these processes. "
            "Coverage is that of values whose process is certain; where the program says that it cannot tell, it is "
            "counted as that."
        ),
    ),
    "judge": (
        Markup(
            "Judged records: three minutes of readings and GNSS fixes with turns and climbs, made by equations of "
            "their own, with at most one wrong thing each, which stands behind the comma; <em>nothing</em>, the record "
            "is one of the campaign. What is named first is pasted into the campaign as it is printed, and the record "
            "judged again. An interval along several axes holds where all of them do. The file judged_records.csv has "
            "every record."
        ),
    ),
}
"""Descriptions of other systems, by their group."""

SIGN: Final = Markup('<span class="mark">{}</span>').format


def render(table: pd.DataFrame) -> str:
    """Render the page from a table of rates."""
    groups = table["system"].map(_group)
    picked = {key: table[(groups == key[0]) & (table["kind"] == key[1])] for key in TITLES}
    notes = [SYSTEMS, *(note for group, own in OTHERS.items() if group in set(groups) for note in own)]
    campaigns = table.groupby(["system", "sources", "design", "samples"])["campaigns"].max().sum()
    intro = (
        f"Coverage of intervals, false alarms and power, measured on {campaigns:,} independent synthetic campaigns; "
        "each rate states their number. The moments of the systems are known in closed form. Rates are in per cent, "
        "with exact binomial intervals at 95 %. The nominal level of each "
        "statement is 95 % unless given otherwise."
    )
    sections = [_section(own, *key, TITLES[key]) for key, own in picked.items() if len(own)]
    return page_html(Page(
        "Calibration", "Measured error rates", "Calibration: validation of the statistics", [Sentence(intro)],
        [Section("findings", "Findings", [_finding_table(table), *map(Note, notes)]), *sections],
    ))  # fmt: skip


def _finding_table(table: pd.DataFrame) -> Table[str]:
    """Tabulate how many rates there are of each finding."""
    counts = table[table["finding"] != ""]["finding"].value_counts()
    columns: list[Column[str]] = [
        Column("Finding", lambda name: Cell(name, tone=FINDINGS[name][0]), kind="label"),
        Column("Rates", lambda name: int(counts.get(name, 0)), form=counted),
        Column("Sign", lambda name: FINDINGS[name][1] or "none", kind="label"),
        Column("Measured rate", lambda name: FINDINGS[name][2], kind="words"),
    ]
    return Table("Number of rates by finding, and their signs in the tables below.", columns, list(FINDINGS))


def write_calibration(folder: Path, trials: int, jobs: int, alone: str = "") -> tuple[pd.DataFrame, list[Path]]:
    """Measure all rates, write the page and its CSV file, and return the table of rates and the files.

    With one of `ALONE` those alone; the others are those of the CSV file in the folder.
    """
    import pandas as pd

    def judged() -> Tally:
        return count(measure(folder / JUDGE_CSV, max(round(trials / JUDGED_SHARE), 2)))

    if alone:
        earlier = pd.read_csv(folder / CSV, keep_default_na=False, na_values={"nominal": [""]})
        run = {"rare": lambda: run_rare_trials(trials, jobs, folder / RARE_CSV), "judge": judged}
        measured = rates(run.get(alone, lambda: run_slow_trials(trials, jobs))())
        others = earlier[~earlier["system"].isin(measured["system"])]
        table = pd.concat([others, measured]).sort_values(list(earlier)[:6], kind="stable")
    else:
        counted = run_trials(trials, jobs, DESIGNS)
        for more in (
            run_noise_trials(trials, jobs), run_tail_trials(trials, jobs),
            run_filter_trials(trials, jobs), run_kalman_trials(trials, jobs),
            run_navigation_trials(max(trials // SHARE, 2), jobs),
            run_identification_trials(max(trials // RECORDS_SHARE, 2), jobs),
            run_slow_trials(trials, jobs),
            run_rare_trials(trials, jobs, folder / RARE_CSV), judged(),
        ):  # fmt: skip
            counted += more
        table = rates(counted)
    texts = {"calibration.html": render(table)}
    texts[CSV] = table.to_csv(index=False, float_format="%.4f")
    return table, write_texts(folder, texts)


def _group(system: str) -> str:
    return next((group for beginning, group in GROUPS.items() if system.startswith(beginning)), "")


def _section(table: pd.DataFrame, group: str, kind: str, title: str) -> Section:
    name = kind.replace(" ", "-")
    name = f"{group}-{name}" if group else name
    return Section(name, title, [_figure(table, name, kind, title), Folded("All rates", [_rate_table(table)])])


@dataclass(frozen=True)
class _Rates:
    """Rates of a statement on a system by the number of samples."""

    statement: str
    system: str
    sources: str
    design: str
    nominal: str
    by_size: Mapping[int, Cell]


def _rate_table(table: pd.DataFrame) -> Table[_Rates]:
    """Tabulate the rates, one row per statement, system, distribution and design, with a cell for every size."""
    rows = []
    for (statement, system, sources, design), group in table.groupby(["statement", "system", "sources", "design"]):
        cells = {}
        for row in group.to_dict("records"):
            tone, sign, _ = FINDINGS.get(row["finding"], ("", "", ""))
            rate = f"{100.0 * row['measured']:.1f}"
            text = Markup("{}{}").format(label(rate, tone) if tone else rate, SIGN(sign) if sign else "")
            cells[row["samples"]] = Cell(text, below=f"{100.0 * row['low']:.1f} to {100.0 * row['high']:.1f}")
        nominal = group["nominal"].iloc[0]
        shown = "–" if nominal != nominal else f"{100.0 * nominal:g}"
        rows.append(_Rates(statement, system, sources, design, shown, cells))

    def of_size(size: int) -> Column[_Rates]:
        return Column(f"N = {size:,}", lambda row: row.by_size.get(size, Cell("–")))

    columns: list[Column[_Rates]] = [
        Column("Statement", lambda row: row.statement, kind="words"),
        Column("System, sources", lambda row: Cell(row.system, below=row.sources), kind="words"),
        Column("Design", lambda row: row.design, kind="text"),
        Column("Nominal", lambda row: row.nominal),
        *map(of_size, sorted(table["samples"].unique())),
    ]
    caption = (
        "Measured rates, %. A dash: the statement is not made, because the design has too few independent blocks or "
        "the test does not apply to it."
    )
    return Table(caption, columns, rows, style="marked")


def _figure(own: pd.DataFrame, name: str, kind: str, title: str) -> Figure:
    """Draw rates of one kind, one row per statement, and separately those that the program reports."""
    statements = list(dict.fromkeys(own["statement"]))
    figure = [finding for finding in MARKS if (own["finding"] == finding).any()]
    sizes = sorted(own["samples"].unique())

    def panel(name: str, shown: pd.DataFrame) -> Panel:
        marks: list[Mark] = [Rule(100.0 * nominal, colour=INK) for nominal in shown["nominal"].dropna().unique()]
        for finding in figure:
            rates = shown[shown["finding"] == finding]
            rows = np.array([statements.index(statement) for statement in rates["statement"]])
            shifts = np.searchsorted(sizes, rates["samples"]) - 0.5 * (len(sizes) - 1)
            marks.append(Points(MARKS[finding], 100.0 * rates["measured"], rows + 0.16 * shifts, 5.3))
        return Panel(name, Axis("campaigns", "%"), Axis(names=statements), marks)

    panels = [panel("All rates", own)]
    if "withheld" in figure:
        panels.append(panel("Reported by the program", own[own["finding"] != "withheld"]))
    return Figure(
        name=name,
        title=title,
        description=f"Measured rates ({kind}) for every statement, system, distribution, design and size; the line is "
        "the nominal rate.",
        panels=panels,
        key=[MARKS[finding] for finding in figure] if figure != [""] else (),
        columns=dict(own.drop(columns="kind").items()),
        size=(HALF[0], 82.0 + 33.0 * len(statements)),
        caption="One mark per system, distribution, design and number of samples, which increases downwards within a "
        "row.",
        file=CSV,
    )
