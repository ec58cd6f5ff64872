"""Verdict of samples on a linear covariance: its sentence, its table, its figure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pandas as pd

from mcnav.analysis.verdict import Verdict
from mcnav.arrays.types import Array

WORDS: Final = {
    Verdict.AGREES: "The covariance holds: each sigma agrees within {tolerance:.0%}.",
    Verdict.DIFFERS: "Do not use this covariance for {differing}: the simulated sigma differs by more than "
    "{tolerance:.0%}.",
    Verdict.UNDECIDED: "No verdict yet for {undecided}: {remedy}.",
}


OWN_SIGMA: Final = "(each in its sigma)"

PAIRED: Final = """\
Monte Carlo is the sigma of the samples. Paired takes out the scatter of the draws, which both sides share; the
difference is its own."""


@dataclass(frozen=True)
class CovarianceVerdict:
    """Verdict of samples on a covariance.

    Attributes
    ----------
    frame : DataFrame, shape (outputs, columns)
        A row an output, SI, with the columns of `RunResult.outputs`: ``unit``, ``sigma_linear``, ``sigma_plain`` of
        the samples and, where draws and P were given, ``sigma_paired``; ``ratio_paired``, else ``ratio_plain``, the
        simulated over the linear sigma, with ``_from`` and ``_to`` at the confidence of all verdicts together;
        ``verdict`` and ``samples_needed``.
    verdict : str
        ``agrees``, ``differs`` or ``undecided``, of the sigmas; ``partly`` where these agree and the matrix does not.
    joint : str
        Verdict on the whole matrix, by mean NEES; empty for a matrix of zeros.
    nees, nees_expected : float
        Mean normalised estimation error squared, paired where it can be, and its expectation.
    sample_covariance : DataFrame, shape (outputs, outputs)
        Covariance of the successful samples, SI, as `pandas.DataFrame.cov` has it.
    worst_direction : Series, shape (outputs,)
        Weights, in units of the outputs' sigmas, of the combination with the worst sigma ratio.
    worst_ratio : float
        Its sigma ratio. The worst of all directions was chosen, so it has no interval.
    samples, failed : int
    paired : bool
        Whether the sampling noise that samples and linear analysis share was taken out.
    without : tuple of str
        Processes of noise that the system has and P S P' has not.
    fixed : Series, shape (outputs,), or None
        Weights, in units of the outputs' sigmas, of the combination that linear analysis treats as exact and that
        varies most all the same; none where there is none.
    fixed_sigma : float
        Its simulated sigma, in sigmas of the output with the weight one.

    Examples
    --------
    >>> import mcnav as mc
    >>> import numpy as np
    >>> errors = mc.Errors({"a": 1.0, "b": 2.0})
    >>> draws = errors.draw(4000, seed=1)
    >>> P = mc.partials(lambda e: e, errors)
    >>> verdict = mc.compare(mc.propagate_covariance(P, errors), mc.simulate(lambda e: e, draws), draws, P)
    >>> verdict.verdict, bool(abs(verdict.frame["ratio_paired"] - 1.0).max() < 1e-9)
    ('agrees', True)
    """

    frame: pd.DataFrame
    verdict: str
    joint: str
    nees: float
    nees_expected: float
    sample_covariance: pd.DataFrame
    worst_direction: pd.Series
    worst_ratio: float
    samples: int
    failed: int
    paired: bool
    without: tuple[str, ...]
    tolerance: float
    confidence: float
    fixed: pd.Series | None = None
    fixed_sigma: float = 0.0

    @property
    def sentence(self) -> str:
        """The verdict and its consequence."""
        verdicts = self.frame["verdict"]
        on_sigmas = "agrees" if self.verdict == "partly" else self.verdict
        words = WORDS[Verdict(on_sigmas)]
        open_ = ", ".join(verdicts.index[verdicts == "undecided"]) or "these samples"
        text = words.format(
            tolerance=self.tolerance, differing=", ".join(verdicts.index[verdicts == "differs"]), undecided=open_,
            remedy=self._remedy,
        )  # fmt: skip
        if self.verdict == "partly":
            text = "Each sigma is right; the full covariance matrix is not. Do not gate or fuse with it."
        if self.without:
            text += f" P S P' leaves out the noise of {', '.join(self.without)}; mcnav.linear has it."
        return text + (f" {self.failed:,} of {self.samples + self.failed:,} samples failed." if self.failed else "")

    @property
    def _kind(self) -> str:
        return "paired" if self.paired else "plain"

    @property
    def _ends(self) -> Array:
        """Ends of the intervals of the ratios, shape (outputs, 2)."""
        ends = [f"ratio_{self._kind}_from", f"ratio_{self._kind}_to"]
        return np.asarray(self.frame[ends].to_numpy(float))

    @property
    def _remedy(self) -> str:
        needed = self.frame["samples_needed"].max()
        if np.isfinite(needed):
            return f"simulate about {needed:,.0f} samples"
        if self.failed:
            return "too many samples failed"
        return "there are too few samples for an interval; simulate at least 100"

    def __str__(self) -> str:
        """Write the verdict as a table."""
        shown = pd.DataFrame(
            {
                "unit": self.frame["unit"],
                "P S P'": self.frame["sigma_linear"].map("{:.5g}".format),
                "Monte Carlo": self.frame["sigma_plain"].map("{:.5g}".format),
                **({"paired": self.frame["sigma_paired"].map("{:.5g}".format)} if self.paired else {}),
                "difference": (self.frame[f"ratio_{self._kind}"] - 1.0).map("{:+.2%}".format),
                "interval": [_interval(*ends) for ends in self._ends],
                "verdict": self.frame["verdict"],
            }
        )
        lines = [
            f"{self.verdict.upper()}  {self.sentence}",
            "",
            f"1 sigma, {self.samples:,} samples",
            shown.to_string(),
        ]
        if self.paired:
            lines.append(PAIRED)
        if self.joint:
            nees = f"full matrix: mean NEES {self.nees:.4g} where {self.nees_expected:.4g} is expected"
            lines += [
                "",
                nees if self.fixed is not None else f"{nees}: {self.joint}",
                f"worst direction: sigma {self.worst_ratio - 1.0:+.2%}, along {_weighted(self.worst_direction)} "
                + OWN_SIGMA,
            ]
        if self.fixed is not None:
            lines.append(
                f"linear analysis treats {_weighted(self.fixed)} {OWN_SIGMA} as exact; it varies by "
                f"{self.fixed_sigma:.3g} sigma: differs"
            )
        return "\n".join(lines)

    __repr__ = __str__

    def plot(self, ax: Any = None) -> Any:
        """Draw each ratio with its interval, that of the worst direction, and the tolerance as a band.

        Returns matplotlib's axes.
        """
        ax = draw_ratios(self.frame, self._kind, self.tolerance, self.confidence, ax)
        if self.joint:
            ax.plot([self.worst_ratio], [0], "D", color="C1", label="worst direction of the full matrix")
            ax.set_yticks([*ax.get_yticks(), 0], [*self.frame.index, "worst direction"])
            ax.legend(loc="best", fontsize="small")
        return ax


def draw_ratios(table: pd.DataFrame, kind: str, tolerance: float, confidence: float, ax: Any = None) -> Any:
    """Draw the sigma ratios of a table, a row an output, with their intervals and the tolerance as a band.

    Returns matplotlib's axes; rows are at len(table), …, 1.
    """
    import matplotlib.pyplot as plt

    ax = ax or plt.subplots(figsize=(7.0, 1.4 + 0.4 * len(table)), layout="constrained")[1]
    rows = np.arange(len(table), 0, -1)
    ratio, low, high = (table[f"ratio_{kind}{end}"].to_numpy(float) for end in ("", "_from", "_to"))
    known = np.isfinite(low) & np.isfinite(high)
    ax.axvspan(1.0 - tolerance, 1.0 + tolerance, color="0.9", label=f"within {tolerance:.0%}")
    ax.errorbar(
        ratio[known], rows[known], xerr=np.abs(np.array([low, high])[:, known] - ratio[known]), fmt="o", capsize=3,
        label=f"simulated over linear sigma, {confidence:.0%}",
    )  # fmt: skip
    ax.plot(ratio[~known], rows[~known], "o", fillstyle="none")
    ax.set_yticks(rows, list(table.index))
    ax.set_xlabel("simulated sigma / linear sigma")
    ax.legend(loc="best", fontsize="small")
    return ax


def _weighted(weights: pd.Series) -> str:
    """Write a combination of outputs, without the small terms."""
    shown = weights[weights.abs() > 0.05 * weights.abs().max()]
    return " ".join(f"{weight:+.3f} {name}" for name, weight in shown.items())


def _interval(low: float, high: float) -> str:
    return "–" if not np.isfinite([low, high]).all() else f"{low - 1.0:+.2%} to {high - 1.0:+.2%}"
