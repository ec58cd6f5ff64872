"""Examination of linear analysis in sentences: where it holds, where it does not, and what to do."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from mcnav.report.format import number
from mcnav.report.names import humanize, scale_of
from mcnav.report.statements.words import joined, several

if TYPE_CHECKING:
    from mcnav.analysis.examination import Examination
    from mcnav.analysis.linear_answer import LinearAnswer

TONES: Final = {"holds": "agrees", "does not hold": "differs", "cannot say": "undecided"}

UNSEEN: Final = "Errors rarer than one in 30 would be missed"
"""Limit of few simulations, which rarely meet a jump: it is stated wherever an output holds."""

NAMED: Final = 2
"""Outputs that are named with their ratios."""


def examination_words(answer: LinearAnswer) -> Iterator[tuple[str, str]]:
    """Say where linear analysis holds, in one statement with its tone; nothing where it was not examined."""
    if answer.unexamined:
        yield f"Linear analysis was not examined: {answer.unexamined}. mcnav lincov --examine does it", ""
    if answer.examination is not None:
        yield _statement(answer, answer.examination)


def corrected_words(answer: LinearAnswer) -> Iterator[tuple[str, str]]:
    """State the mean NEES of second order where it is known well enough and the linear one is not right."""
    examined, rank = answer.examination, answer.model.whitened.rank
    if examined is None or examined.corrected is None or examined.joint is None or examined.joint.verdict == "holds":
        return
    if examined.corrected.improves_nees(rank):
        nees = number(examined.corrected.nees, 4)
        yield f"Mean NEES to second order: {nees}, where linear analysis has {rank}", ""


def _corrected_sigmas(answer: LinearAnswer, examined: Examination) -> str:
    """State sigmas of second order where they are known well enough and linear ones are not right; else empty."""
    corrected, scale = examined.corrected, scale_of(answer.outputs)
    if corrected is None:
        return ""
    improved = corrected.improves(answer.sigma)
    shown = [
        f"{humanize(output.name)} {number(corrected.sigma[i] * scale[i], 3)} {output.shown_in} (linear "
        f"{number(answer.sigma[i] * scale[i], 3)})"
        for i, output in enumerate(answer.outputs)
        if improved[i] and examined.outputs[i].verdict != "holds"
    ]
    return f"Sigma to second order: {several(shown, NAMED)}" if shown else ""


def _statement(answer: LinearAnswer, examined: Examination) -> tuple[str, str]:
    begin = f"Linear analysis, examined by {examined.flights:,} flights"
    if examined.failed and all(output.verdict == "cannot say" for output in examined.outputs):
        return f"{begin}: cannot say, since {examined.failed:,} of them failed. Run samples", "undecided"
    names = [humanize(output.name) for output in answer.outputs]
    verdicts = [output.verdict.value for output in examined.outputs]
    together = "" if examined.joint is None else examined.joint.verdict.value
    if {*verdicts, together} <= {"holds", ""}:
        return f"{begin}: holds for all {len(names)} outputs, each alone and together. {UNSEEN}", "agrees"
    sentences = [f"{begin}: holds for {verdicts.count('holds')} of {len(names)} outputs"]
    failing = sorted(
        ((name, output) for name, output in zip(names, examined.outputs, strict=True)
         if output.verdict == "does not hold"),
        key=lambda named: (not math.isnan(named[1].ratio), -abs(named[1].ratio - 1.0)),
    )  # fmt: skip
    if failing:
        worst = [f"{name} ({_departure(output.ratio)})" for name, output in failing[:NAMED]]
        more = f" and {len(failing) - NAMED} more" if len(failing) > NAMED else ""
        sentences.append(f"It fails for {', '.join(worst) if more else joined(worst)}{more}")
    if corrected := _corrected_sigmas(answer, examined):
        sentences.append(corrected)
    unknown = [name for name, verdict in zip(names, verdicts, strict=True) if verdict == "cannot say"]
    if unknown:
        sentences.append(f"Cannot say for {several(unknown)}: run samples")
    if together == "does not hold":
        sentences.append("Do not gate or fuse with the full matrix, which is wrong")
    elif together == "cannot say":
        sentences.append("It cannot say for the full covariance matrix: run samples before you use it")
    if "holds" in verdicts:
        sentences.append(UNSEEN)
    worst_verdict = next(verdict for verdict in ("does not hold", "cannot say") if verdict in (*verdicts, together))
    tone = "partly" if worst_verdict == "does not hold" and "does not hold" not in verdicts else TONES[worst_verdict]
    return ". ".join(sentences), tone


def _departure(ratio: float) -> str:
    return "linear sigma zero" if math.isnan(ratio) else f"{ratio:.2f} times the linear sigma"
