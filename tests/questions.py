"""The table of questions and systems in the guide, written from what trying gives: ``python -m tests.questions``.

Every cell is tried on the smallest campaign of its system. A cell without an answer has its reason, which the line of
the command that refuses it has as well.
"""

from __future__ import annotations

import shutil
import string
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final
from unittest.mock import patch

import numpy as np
import tomli_w

from mcnav.analysis.answer_times import as_read
from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.analysis.requirements import requirements_from
from mcnav.config.campaign import Campaign
from mcnav.config.read import parse_campaign, read_campaign
from mcnav.contract.questions import Question, reason_against
from mcnav.contract.scenario import has_gates
from mcnav.errors import CampaignError
from mcnav.report.pages.brief import Links
from mcnav.report.pages.brief import page as brief_page
from mcnav.store.manifest import ExceedanceRecord
from mcnav.store.run_folder import RunFolder
from mcnav.studies.allocate import allocate
from mcnav.studies.changeable_content import changeable_content
from mcnav.studies.linear_answers import answer_linearly
from mcnav.studies.linearity import linearity_study
from mcnav.studies.live import LiveCampaign
from mcnav.studies.start_times import start_time_study
from mcnav.studies.sweep import SweepPlan, run_sweep
from mcnav.workflow import exceedance
from mcnav.workflow.analyse import analyse
from mcnav.workflow.prepare import prepare_system
from mcnav.workflow.replay import replay
from mcnav.workflow.run import Run
from mcnav.workflow.what_if import what_if_of_answer
from tests.runs import simulate
from tests.strapdown_loops import FIXES, FLIGHT

PAGE: Final = Path(__file__).parent.parent / "mcnav" / "docs" / "GUIDE.md"
HEADING: Final = "## What can be asked of which system\n"
INTRODUCTION: Final = """\
“Rare events” are requirements whose permitted probability of violation is too small to verify by counting samples.
`Strapdown` is the inertial navigator of a closed loop. Epochs are the times at which errors are tabulated. Each cell
was tried on a small campaign (`python -m tests.questions`). Closed loops with constant errors had no measurements.
"""
UNTOLD: Final = "is left out without a word"
CODE: Final = Path(__file__).with_name("questioned.py")
HEAD: Final = {"samples": 12, "seed": 1}

Content = dict[str, Any]

_INS_ERRORS: Final = {"position": "10 m", "tilt": "0.5 mrad"}
_SHORT: Final = {**FLIGHT, "end": "40 s"}
_QUIET_IMU: Final = {"gyro": {"bias": "1 deg/h"}, "accelerometer": {"bias": "1 mg"}}
_IMU: Final = {"gyro": {"bias": "1 deg/h", "angle_random_walk": "0.1 deg/sqrt(h)"}, "accelerometer": {"bias": "1 mg"}}
_ONE_AXIS: Final = {"position": "3 m", "velocity": "0.2 m/s"}
_OF_HOPPER: Final = {"position": "10 m", "velocity": "1 m/s", "attitude": "1 mrad"}

_SYSTEMS: Final[dict[str, Content]] = {
    "reentry": {"scenario": {"type": "reentry", "trajectory": 4}, "errors": {"altitude": "1 km", "bias_x": "50 ug"}},
    "guided reentry": {
        "scenario": {"type": "reentry", "trajectory": 4, "guidance": {"input": "indicated"}},
        "errors": {"altitude": "10 m", "altitude_rate": "0.03 m/s"},
    },
    "cruise": {
        "scenario": {"type": "cruise", "speed": "250 m/s", "duration": "1 h"},
        "errors": {"gyro_drift": "0.01 deg/h", "bias_x": "50 ug"},
    },
    "hover": {
        "scenario": {"type": "hover", "duration": "20 min"},
        "errors": {"gyro_drift": "0.01 deg/h", "bias_x": "50 ug"},
    },
    "`ins`, free": {"scenario": _SHORT, "imu": _IMU, "errors": _INS_ERRORS},
    "`ins`, aided": {
        "scenario": _SHORT, "imu": _IMU, "errors": _INS_ERRORS, "aiding": [FIXES],
        "filter": {"estimates": ["position", "velocity", "attitude"]},
    },
    "closed loop": {
        "scenario": {"type": "questioned.py:Loop"}, "errors": _ONE_AXIS,
        "processes": {"disturbance": "0.1 m/s^2/sqrt(Hz)"}, "measurements": {"ranging": "2 m"},
    },
    "loop with `Strapdown`": {
        "scenario": {"type": "questioned.py:Hopper"}, "errors": _OF_HOPPER, "imu": _IMU, "measurements": {"fix": "5 m"},
    },
    "class of your own": {"scenario": {"type": "questioned.py:Line"}, "errors": {"start": "1 m", "drift": "0.1 m/s"}},
}  # fmt: skip
"""The smallest campaign of each system, with noise and a filter where it can have them."""

_QUIET: Final[dict[str, Content]] = {
    "`ins`, free": {"scenario": _SHORT, "imu": _QUIET_IMU, "errors": _INS_ERRORS},
    "closed loop": {"scenario": {"type": "questioned.py:QuietLoop"}, "errors": _ONE_AXIS},
    "loop with `Strapdown`": {
        "scenario": {"type": "questioned.py:QuietHopper"}, "errors": _OF_HOPPER, "imu": _QUIET_IMU,
    },
    "class of your own": {
        "scenario": {"type": "questioned.py:QuietLine"}, "errors": {"start": "1 m", "drift": "0.1 m/s"},
    },
}  # fmt: skip
"""The same with constant errors alone."""

_SENSORS: Final = {
    "`ins`, aided": ("position_fix", "position_north", "20 s"),
    "closed loop": ("ranging", "ranging", "6 s"),
    "loop with `Strapdown`": ("fix", "fix_1", "5 s"),
}
"""A sensor of each system, one of its components, and a time at which it measures."""

MEASURED: Final = "every measurement has noise, so errors are never constant alone"


@dataclass(frozen=True)
class Subject:
    """A system that is asked, with what several questions need of it."""

    name: str
    folder: Path

    @cached_property
    def file(self) -> Path:
        """Its campaign file, with a requirement that it does not meet, beside the systems of one's own."""
        shutil.copy(CODE, self.folder / CODE.name)
        path = self.folder / "campaign.toml"
        path.write_text(tomli_w.dumps({**HEAD, **_SYSTEMS[self.name]}), encoding="utf-8")
        self.__dict__["file"] = path  # which the limit needs
        path.write_text(tomli_w.dumps({**HEAD, **_SYSTEMS[self.name], "accept": {"quantile": [self.limit(1.0)]}}))
        return path

    def campaign(self, quiet: bool = False, **tables: Any) -> Campaign:
        """Read its campaign with other tables."""
        content = {**HEAD, **(_QUIET if quiet and self.name in _QUIET else _SYSTEMS)[self.name], **tables}
        return parse_campaign(content, str(self.file), "campaign")

    @cached_property
    def plain(self) -> Campaign:
        """The campaign without further tables."""
        return self.campaign()

    @cached_property
    def middle(self) -> float:
        """A time within the flight that is no epoch, s; of a system without times the first one."""
        times = self.plain.scenario.reading_times
        return float(0.4 * times[0] + 0.6 * times[-1]) + 0.125 if len(times) else 1.0

    @cached_property
    def answer(self) -> LinearAnswer:
        """The linear answer."""
        return answer_linearly(self.plain)

    @cached_property
    def output(self) -> int:
        """Number of the output with a sigma that requirements limit."""
        return int(np.argmax(self.answer.sigma > 0.0))

    def limit(self, sigmas: float) -> Content:
        """Return a requirement on an output, so many of its final sigmas."""
        output = self.plain.scenario.outputs[self.output]
        below = f"{sigmas * self.answer.sigma[self.output]:.6g} {output.unit}"
        return {"output": output.name, "probability": 0.999, "below": below}

    @cached_property
    def run(self) -> Run:
        """A run of a few samples."""
        return simulate(read_campaign(self.file), self.folder / "run", None, 1)


def _shown(answered: bool) -> str:
    return "" if answered else UNTOLD


def _rare(subject: Subject, quiet: bool, over_time: bool) -> str:
    """Try the flights of a requirement that counting cannot decide: whether they are chosen, and two of them."""
    if quiet and not subject.plain.scenario.noisy:
        quiet = False
    flown: list[np.ndarray[Any, Any]] = []

    def fly(number: int, normals: Any, *_: object) -> ExceedanceRecord:
        flown.append(normals.fly(0.1 * np.ones((2, normals.dimensions)), np.arange(2)))
        return exceedance._refused(number, "")

    when = {"after": f"{subject.plain.scenario.reading_times[0]} s"} if over_time else {}
    answer = answer_linearly(subject.campaign(quiet))
    sigma = answer.sigma if answer.history is None or not over_time else answer.history.sigma.max(axis=0)
    limit = subject.limit(4.5 * sigma[subject.output] / subject.answer.sigma[subject.output])
    campaign = subject.campaign(quiet, accept={"quantile": [limit | when]}, samples=2_000)
    system = prepare_system(campaign, campaign.scenario.engines[0], force=True)
    outputs = [output.name for output in campaign.scenario.outputs]
    required = requirements_from(campaign.requirements, outputs)
    with patch.object(exceedance, "_estimate", fly):
        records = exceedance.estimate_exceedances(system, required, 0.95)
    if not flown:
        return str(records[0].refusal) if records else "is left to counting"
    return _shown(bool(np.isfinite(flown[0]).all()))


def _constant(subject: Subject) -> str:
    return MEASURED if subject.plain.scenario.noisy and subject.name not in _QUIET else _rare(subject, True, False)


def _with_noise(subject: Subject) -> str:
    return reason_against(Question.NOISE, subject.plain.scenario.parts) or _rare(subject, False, False)


def _budget(subject: Subject) -> str:
    return _shown(subject.answer.budget.shares.size > 0)


def _over_time(subject: Subject) -> str:
    return _shown(subject.answer.history is not None)


def _at_any_time(subject: Subject) -> str:
    return _shown(answer_linearly(subject.plain, np.array([subject.middle])).asked is not None)


def _around_updates(subject: Subject) -> str:
    history = subject.answer.history
    return _shown(history is not None and {"before", "after"} <= set(history.readings.updates))


def _start_times(subject: Subject) -> str:
    return _shown(len(start_time_study(subject.campaign(start_times={"count": 3})).times) >= 2)


def _filter(subject: Subject) -> str:
    return _shown(subject.answer.filter is not None and subject.run.results.filter is not None)


def _smoother(subject: Subject) -> str:
    filtered = _SYSTEMS[subject.name].get("filter", {}) | {"smoother": "fixed-interval"}
    return _shown(answer_linearly(subject.campaign(filter=filtered)).smoothed is not None)


def _gates(subject: Subject) -> str:
    filtered = _SYSTEMS[subject.name].get("filter", {}) | {"gate": 0.999}
    return _shown(answer_linearly(subject.campaign(filter=filtered)).rejections is not None)


def _faults(subject: Subject) -> str:
    sensor, component, begin = _SENSORS.get(subject.name, ("gnss", "position_north", "5 s"))
    spike = {"kind": "spike", "sensor": sensor, "component": component, "begin": begin, "size": "30 m"}
    campaign = subject.campaign(faults=[spike])
    errors = campaign.errors
    return _shown(
        has_gates(campaign.scenario) and len(campaign.scenario.fault_laws(errors.mean, errors.covariance)) == 1
    )


def _what_if(subject: Subject) -> str:
    return _shown(what_if_of_answer(as_read(subject.answer), *changeable_content(subject.plain)) is not None)


def _replay(subject: Subject) -> str:
    subject.run  # noqa: B018  there it is
    return _shown(len(replay(subject.folder / "run", 1, subject.file).outcomes) >= 2)


def _live(subject: Subject) -> str:
    live = LiveCampaign(subject.file, subject.folder / "live", 1)
    live.tune(1, {_size(subject): 1.1})
    settings = live.state()["settings"]
    return _shown(isinstance(settings, list) and len(settings) == 2)


def _size(subject: Subject) -> str:
    """Return the key of a size in the file."""
    return f"errors.{next(iter(_SYSTEMS[subject.name]['errors']))}"


def _brief(subject: Subject) -> str:
    subject.run  # noqa: B018  there it is
    content = analyse(RunFolder(subject.folder / "run"))
    return _shown(bool(brief_page(content, Links("run", "")).head))


def _allocate(subject: Subject) -> str:
    return _shown(bool(allocate(subject.file, confirm=0, examine=False).goals))


def _sweep(subject: Subject) -> str:
    size = str(_SYSTEMS[subject.name]["errors"][_size(subject).removeprefix("errors.")])
    number, _, unit = size.partition(" ")
    plan = SweepPlan({_size(subject): f"{number}, {2.0 * float(number):g} {unit}"}, jobs=1, examine=False)
    return _shown(bool(np.isfinite(run_sweep(subject.plain, plan).values).all()))  # which has no limit to search for


def _linearity(subject: Subject) -> str:
    return _shown(bool(linearity_study(subject.plain, samples=24, largest=1.0).samples))


@dataclass(frozen=True)
class _Row:
    """A question of the table: its words, how it is tried, and the question of the contract that it is."""

    words: str
    ask: Callable[[Subject], str]
    question: Question | None = None


ROWS: Final = (
    _Row("error budget", _budget),
    _Row("errors over time", _over_time, Question.OVER_TIME),
    _Row("at any time (`--at`)", _at_any_time, Question.ANY_TIME),
    _Row("before and after updates", _around_updates, Question.UPDATES),
    _Row("start times", _start_times, Question.START_TIMES),
    _Row("filter and NEES", _filter, Question.FILTER),
    _Row("smoother", _smoother, Question.SMOOTHER),
    _Row("gates", _gates, Question.GATES),
    _Row("faults", _faults, Question.FAULTS),
    _Row("rare events, constant errors", _constant),
    _Row("rare events with noise", _with_noise, Question.NOISE),
    _Row("rare events over time", lambda subject: _rare(subject, False, True), Question.OVER_TIME),
    _Row("what if", _what_if),
    _Row("replay", _replay),
    _Row("live", _live),
    _Row("brief", _brief),
    _Row("allocate", _allocate),
    _Row("sweep", _sweep),
    _Row("range of linearity", _linearity),
)


def try_cell(subject: Subject, row: _Row) -> str:
    """Return why a question has no answer of a system; empty where it has one.

    What a command prints where it refuses has the reason in it.
    """
    reason = "" if row.question is None else reason_against(row.question, subject.plain.scenario.parts)
    try:
        line = row.ask(subject)
    except CampaignError as refused:
        line = str(refused.problems[0]).removeprefix(f"{subject.file}: ")
    if not reason:
        return line
    assert line == UNTOLD or reason in line, f"{subject.name}, {row.words}: {line!r} does not say: {reason}"
    return reason


def section() -> str:
    """Try all cells and write them as the section of the guide."""
    rows = {row.words: [row.words] for row in ROWS}
    letters: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as folder:
        for number, name in enumerate(_SYSTEMS):
            subject = Subject(name, Path(folder) / str(number))
            subject.folder.mkdir()
            for row in ROWS:
                reason = try_cell(subject, row)
                letter = letters.setdefault(reason, string.ascii_lowercase[len(letters)]) if reason else ""
                rows[row.words].append(f"no ({letter})" if letter else "yes")
    head = ["question", *_SYSTEMS]
    lines = [f"| {' | '.join(cells)} |" for cells in (head, ["---"] * len(head), *rows.values())]
    reasons = [f"- ({letter}) {reason}" for reason, letter in letters.items()]
    return "\n".join((HEADING, INTRODUCTION, *lines, "", "Reasons as the commands print them:", "", *reasons)) + "\n\n"


def with_section(page: str, written: str) -> str:
    """Replace the section of the guide by a new one."""
    before, _, after = page.partition(HEADING)
    rest = after[after.index("\n## ") + 1 :]
    return before + written + rest


if __name__ == "__main__":
    PAGE.write_text(with_section(PAGE.read_text(encoding="utf-8"), section()), encoding="utf-8")
    print(f"written: {PAGE}")
