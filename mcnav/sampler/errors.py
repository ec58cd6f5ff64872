"""Error sources by name: their covariance S, and the sampler that draws them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, Final

import numpy as np
import pandas as pd

from mcnav.sampler.designs import DESIGNS
from mcnav.sampler.error_model import Correlation, CorrelationError, ErrorModel
from mcnav.sampler.sizes import ErrorSize, size_of

SAMPLING: Final = "sampling"
"""Key of ``attrs`` under which draws carry design, seed and tails, on which intervals depend."""

SECOND_MOMENTS: Final = "second moments"
"""Key of ``attrs`` of draws under which covariance and mean of the errors are, as one matrix about zero."""


class Errors:
    """The sampler's input: error sources with their distributions and correlations.

    Parameters
    ----------
    sizes : mapping of str to float, str, quantity or distribution
        By error source: one sigma of a normal error as an SI float, text with a unit, or a pint quantity; or a
        distribution: `mcnav.normal`, `mcnav.uniform`, `mcnav.student_t`, `mcnav.triangular`,
        `mcnav.truncated_normal`, `mcnav.fixed`, `mcnav.table`, or a frozen one of scipy.stats, whose values are SI.
    correlations : mapping of (str, str) to float, optional
        Pearson's coefficient by pair of sources.

    Attributes
    ----------
    names : tuple of str
    units : dict of str to str
        SI unit by source; empty where a size was a float, which has none.

    Raises
    ------
    ValueError
        When a size or correlation is impossible, in a line that names its source.

    Examples
    --------
    >>> import mcnav as mc
    >>> errors = mc.Errors({"altitude": "5 km", "bias": mc.uniform("100 ug"), "tilt": 2e-4},
    ...                    correlations={("altitude", "tilt"): 0.3})
    >>> errors.units
    {'altitude': 'm', 'bias': 'm/s^2', 'tilt': ''}
    >>> errors.covariance.loc["altitude", "tilt"]
    np.float64(0.3)
    >>> errors.draw(3, seed=1).round(5)
         altitude     bias     tilt
    0 -7500.20044 -0.00083 -0.00057
    1 -3449.86152 -0.00039 -0.00011
    2   661.45680  0.00065  0.00016
    """

    def __init__(self, sizes: Mapping[str, Any], correlations: Mapping[tuple[str, str], float] | None = None) -> None:
        if not isinstance(sizes, Mapping) or not sizes:
            got = "none" if isinstance(sizes, Mapping) else type(sizes).__name__
            raise ValueError(f"Errors needs a mapping of one or more error sources to their sizes; got {got}")
        self.sizes: dict[str, ErrorSize] = {}
        for name, size in sizes.items():
            try:
                self.sizes[str(name)] = size_of(size)
            except ValueError as wrong:
                raise ValueError(f"{name}: {wrong}") from None
        if correlations is not None and not isinstance(correlations, Mapping):
            expected = "a mapping such as {('altitude', 'tilt'): 0.3}"
            raise ValueError(f"correlations: expected {expected}; got {type(correlations).__name__}")
        self.correlations = dict(correlations or {})
        pairs = [self._pair(between, value) for between, value in self.correlations.items()]
        if len({frozenset(pair.between) for pair in pairs}) < len(pairs):
            raise ValueError("correlations: a pair of sources is given twice, in both orders; leave one out")
        try:
            self.model = ErrorModel(self.names, {name: size.distribution for name, size in self.sizes.items()}, pairs)
        except CorrelationError as wrong:
            between = "correlations"
            if wrong.entry is not None:
                between = f"correlation of {' and '.join(pairs[wrong.entry].between)}"
            raise ValueError(f"{between}: {wrong}") from None

    def _pair(self, between: tuple[str, str], coefficient: float) -> Correlation:
        """Check one correlation; `ValueError` when its sources are not known or its coefficient is no such number."""
        if not isinstance(between, tuple) or len(between) != 2 or len(set(between) & self.sizes.keys()) != 2:
            raise ValueError(f"correlations: {between!r} does not name two of {', '.join(self.names)}")
        number = isinstance(coefficient, (int, float, np.integer, np.floating)) and not isinstance(coefficient, bool)
        if not number or not -1.0 <= coefficient <= 1.0:
            raise ValueError(f"correlation of {' and '.join(between)}: expected -1 to 1; got {coefficient!r}")
        return Correlation(between, float(coefficient))

    @property
    def names(self) -> tuple[str, ...]:
        """Error sources, in the order given."""
        return tuple(self.sizes)

    @property
    def units(self) -> dict[str, str]:
        """SI unit by source; empty where a size was a float."""
        return {name: size.unit for name, size in self.sizes.items()}

    @cached_property
    def covariance(self) -> pd.DataFrame:
        """Start covariance S, shape (sources, sources): SI, row times column (TN D-1772, eq. 11)."""
        table = pd.DataFrame(self.model.covariance, index=self.names, columns=self.names)
        table.attrs["units"] = self.units
        return table

    @property
    def mean(self) -> pd.Series:
        """Mean of each source, SI, shape (sources,)."""
        return pd.Series(self.model.mean, index=self.names)

    @property
    def standard_deviations(self) -> pd.Series:
        """One sigma of each source, SI, shape (sources,)."""
        return pd.Series(self.model.standard_deviations, index=self.names)

    def draw(self, samples: int, seed: int = 1, design: str = "random") -> pd.DataFrame:
        """Draw samples: a row each, a column an error source, SI.

        Parameters
        ----------
        samples : int
            Two or more.
        seed : int
            Sample i depends on seed, design and i alone (with replicated designs also on the number of samples).
        design : str
            ``random``, ``antithetic``, ``latin-hypercube`` or ``sobol``, as in campaigns.

        Raises
        ------
        ValueError
            When there is no such design, or the number of samples or the seed is none.
        """
        for name, value, least in (("samples", samples, 2), ("seed", seed, 0)):
            if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
                raise ValueError(f"{name} must be a whole number of at least {least}; got {value!r}")
        if design not in DESIGNS:
            raise ValueError(f"design must be one of {', '.join(DESIGNS)}; got {design!r}")
        drawn = self.model.draw(design, int(seed), int(samples), 0, int(samples))
        table = pd.DataFrame(drawn, columns=self.names)
        table.attrs = {
            "units": self.units,
            SAMPLING: {
                "design": design,
                "seed": int(seed),
                "samples": int(samples),
                "normal": self.model.normal,
                "heavy_tailed": bool(self.model.heavy_tailed(design)),
            },
            SECOND_MOMENTS: (self.model.covariance + np.outer(self.model.mean, self.model.mean)).tolist(),
        }
        return table

    @property
    def entries(self) -> dict[str, Any]:
        """The table ``[errors]`` of a campaign file with these sources."""
        return {name: size.entry for name, size in self.sizes.items()}

    @property
    def correlation_entries(self) -> list[dict[str, Any]]:
        """The tables ``[[correlations]]`` of a campaign file."""
        return [{"between": list(between), "coefficient": float(value)} for between, value in self.correlations.items()]

    def __repr__(self) -> str:
        return f"Errors: {', '.join(self.names)}"


def as_errors(errors: Errors | Mapping[str, Any] | Sequence[Any]) -> Errors:
    """Return errors that are given as such, or as a mapping of sizes."""
    if isinstance(errors, Errors):
        return errors
    if isinstance(errors, Mapping):
        return Errors(errors)
    raise TypeError(f"expected mcnav.Errors, or a mapping of sizes by error source; got {type(errors).__name__}")


def errors_of(draws: pd.DataFrame) -> Errors | None:
    """Return normal errors with the second moments of what was drawn; none of a frame that `Errors.draw` did not make.

    A filter believes them where its campaign has no errors.
    """
    moments = draws.attrs.get(SECOND_MOMENTS)
    if moments is None or np.shape(moments) != (draws.shape[1],) * 2:
        return None
    matrix, names = np.asarray(moments, dtype=float), list(map(str, draws.columns))
    sigmas = np.sqrt(np.diag(matrix))
    scale = np.where(sigmas > 0.0, sigmas, 1.0)
    correlation = np.clip(matrix / np.outer(scale, scale), -1.0, 1.0)
    pairs = {
        (names[i], names[j]): float(correlation[i, j])
        for i in range(len(names)) for j in range(i) if correlation[i, j] != 0.0
    }  # fmt: skip
    return Errors(dict(zip(names, sigmas.tolist(), strict=True)), pairs)
