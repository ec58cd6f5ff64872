"""The sections on all outputs together: NEES, tests, correlations, and the combination in which they differ."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from markupsafe import Markup

from mcnav.analysis.multivariate import CorrelationDifference, MultivariateTests
from mcnav.analysis.summary import HigherOrder, Summary
from mcnav.report.columns.joint_columns import DirectionRow, directions_table, ellipsoids_table, tests_table
from mcnav.report.document import formulas
from mcnav.report.document.parts import Folded, Lines, Note, Part, Section, Sentence, headed, joined
from mcnav.report.document.table import STRONG, Cell, Column, Table
from mcnav.report.document.table import label as tag
from mcnav.report.drawing.figure import Figure
from mcnav.report.format import fixed, number, with_error
from mcnav.report.results.model import RunAnalysis
from mcnav.report.statements.joint import combination_words, direction_of
from mcnav.statistics.estimates import Estimate


@dataclass(frozen=True)
class EllipsoidWords:
    """The NEES and the combination of outputs that differs most, in words."""

    dimension: str
    mean: str
    plain: str
    paired: str
    about_mean: str
    nees_verdict: str
    verdict: str
    ratio: str
    direction: str
    farthest: str
    combination: str


def ellipsoid_words(content: RunAnalysis) -> EllipsoidWords | None:
    """Describe the NEES and the combination of outputs that differs most; none without a covariance matrix."""
    result, confidence = content.comparison.ellipsoid, content.comparison.confidence_each
    joint = content.summary.joint
    if result is None or joint is None or joint.differing is None:
        return None
    plain, paired = (with_error(each.value, each.reach(confidence)) for each in (result.nees, result.nees_paired))
    return EllipsoidWords(
        dimension=f"{result.dimension}",
        mean=number(result.nees_paired.value),
        plain=plain,
        paired=paired,
        about_mean=number(result.nees_about_mean),
        nees_verdict=result.judgement.verdict.value,
        verdict=result.verdict.value,
        ratio=number(float(result.direction_ratios[result.farthest]), 4),
        direction=direction_of(joint.foremost or joint.differing, content.summary),
        farthest=direction_of(joint.differing, content.summary),
        combination=combination_words(joint.differing, content.summary),
    )


def combination_section(content: RunAnalysis, drawn: Mapping[str, Figure]) -> Section | None:
    """Draw the combination in which the joint distribution is not the linear one; none where it is."""
    figure, words = drawn.get("combination"), ellipsoid_words(content)
    if figure is None or words is None:
        return None
    finding = "differs" if words.verdict == "differs" else "is undecided"
    return Section("combination", f"Where the joint distribution {finding}", [figure])


def joint_section(content: RunAnalysis, drawn: Mapping[str, Figure], differing: Section | None) -> Section:
    """Arrange what is known of all outputs together, of pairs, and of covariances and correlations.

    ``differing``: the section on the combination, if something else decides: it is folded here.
    """
    words, tests = ellipsoid_words(content), content.comparison.joint
    parts: list[Part] = [] if differing is None else [Folded(differing.title, differing.parts)]
    if words is not None:
        parts += [*_nees(words, tests), *joined(drawn.get("nees")), _definition()]
        parts += [] if tests is None else _details(content, tests)
    parts += headed("Pairs of outputs", drawn.get("scatter"))
    parts += headed("Covariances and correlations", drawn.get("matrices"))
    return Section("joint", "Joint distribution", parts)


def _nees(words: EllipsoidWords, tests: MultivariateTests | None) -> list[Part]:
    expected = None if tests is None else tests.nees_expected
    bounds = f"between {number(expected[0])} and {number(expected[1])}" if expected else ""
    exact = f"; if linear analysis were exact, it would lie {bounds}" if bounds else ""
    mean = Markup(
        "The mean squared distance of the errors to the linear covariance, in sigmas, is {} (paired estimate). The "
        "plain estimate is {}{}. Linear analysis expects {}, the rank of P·S·Pᵀ: {}"
    ).format(STRONG(words.paired), words.plain, exact, words.dimension, tag(words.nees_verdict, words.nees_verdict))
    about = Markup(
        "About the sample mean, without the mean error, it is {}. Dispersion differs most in {}; its sigma ratio is {}."
    ).format(words.about_mean, words.farthest, STRONG(words.ratio))
    return [
        Sentence(mean),
        Sentence(about),
        Folded("The combination", [Lines(words.combination, "The combination")], explains=True),
    ]


def _definition() -> Folded:
    words = (
        "The squared distance ε of an error y, in sigmas, uses the linear mean m and the linear covariance. If both "
        "are right, its mean is the number of independent outputs. Its formula is that of NEES:"
    )
    return Folded("Definition of the distance", [Sentence(words), formulas.NEES], explains=True)


def _details(content: RunAnalysis, tests: MultivariateTests) -> list[Part]:
    """Fold the tables of the tests and estimates of all outputs together."""
    summary = content.summary
    few = Note("Other tests require more samples, or a design with independent samples.")
    parts: list[Part] = [
        Folded("Tests of all outputs together", joined(tests_table(summary).read, None if tests.covariance else few)),
        Folded("Principal directions of the difference", [_directions(summary)]),
    ]
    if tests.contained:
        parts.append(Folded("Share of samples within the linear ellipsoids", [ellipsoids_table(summary).read]))
    if tests.correlations:
        parts.append(Folded("Correlations and their differences", [_correlations(content, tests)]))
    return [*parts, Folded("Skewness and kurtosis of each output", [_shapes(content, tests)])]


def _directions(summary: Summary) -> Table[DirectionRow]:
    table: Table[DirectionRow] = directions_table(summary).read
    return table.foremost(lambda row: abs(math.log(row.ratio)) if row.ratio > 0.0 else math.inf, "combinations",
                          "those with the most wrong sigmas")  # fmt: skip


def _correlations(content: RunAnalysis, tests: MultivariateTests) -> Table[CorrelationDifference]:
    names = content.output_names
    columns: list[Column[CorrelationDifference]] = [
        Column("Outputs", lambda row: " and ".join(names[i] for i in row.between), kind="label"),
        Column("Linear", lambda row: fixed(row.linear, 5)),
        Column("Paired", lambda row: fixed(row.paired, 5)),
        Column("Difference", lambda row: _with_reach(content, row.difference)),
    ]
    table = Table("Correlations: linear, paired estimate, and their difference.", columns, tests.correlations)
    return table.foremost(_significance, "pairs", "those that differ most, in standard errors")


def _significance(row: CorrelationDifference) -> float:
    """Return a difference in its standard errors."""
    return abs(row.difference.value) / (row.difference.standard_error or 1.0)


def _with_reach(content: RunAnalysis, estimate: Estimate) -> str:
    """Write a signed estimate with the reach of its interval."""
    return with_error(estimate.value, estimate.reach(content.comparison.confidence_each), sign=True)


@dataclass(frozen=True)
class _Shape:
    """Mean, skewness and excess kurtosis of an output, and those of the fitted polynomial where there is one."""

    title: Cell
    skewness: Estimate
    kurtosis: Estimate
    mean: float
    polynomial_mean: float | None
    polynomial_skewness: float | None
    polynomial_kurtosis: float | None


def _shape(content: RunAnalysis, tests: MultivariateTests, i: int) -> _Shape:
    higher, scale = content.higher_order or HigherOrder(), float(content.output_scale[i])
    mean, skewness, kurtosis = (
        None if values is None else values[i] for values in (higher.mean, higher.skewness, higher.kurtosis)
    )
    return _Shape(
        title=Cell(content.output_names[i], content.output_units[i] if content.higher_order else ""),
        skewness=tests.skewness[i],
        kurtosis=tests.excess_kurtosis[i],
        mean=float(content.comparison.mean_sample[i]) * scale,
        polynomial_mean=None if mean is None else mean * scale,
        polynomial_skewness=skewness,
        polynomial_kurtosis=None if kurtosis is None else kurtosis - 3.0,
    )


def _shapes(content: RunAnalysis, tests: MultivariateTests) -> Table[_Shape]:
    """Tabulate skewness and excess kurtosis beside those of the polynomial, where there is one."""
    known = content.higher_order is not None
    means: list[Column[_Shape]] = [
        Column("Mean", lambda row: row.mean), Column("Higher order", lambda row: row.polynomial_mean),
    ]  # fmt: skip
    skewness: Column[_Shape] = Column("Higher order", lambda row: fixed(row.polynomial_skewness, 3))
    kurtosis: Column[_Shape] = Column("Higher order", lambda row: fixed(row.polynomial_kurtosis, 3))
    columns: list[Column[_Shape]] = [
        Column("Output", lambda row: row.title, kind="label"),
        *(means if known else []),
        Column("Skewness", lambda row: _with_reach(content, row.skewness)),
        *([skewness] if known else []),
        Column("Excess kurtosis", lambda row: _with_reach(content, row.kurtosis)),
        *([kurtosis] if known else []),
    ]
    polynomial = " Higher order: moments of the fitted polynomial in closed form." if known else ""
    caption = (
        "Skewness and excess kurtosis, which are zero for a normal distribution. Intervals here and above hold at "
        f"{100.0 * content.comparison.confidence_each:.4g} % each.{polynomial}"
    )
    return Table(caption, columns, [_shape(content, tests, i) for i in range(len(tests.skewness))])
