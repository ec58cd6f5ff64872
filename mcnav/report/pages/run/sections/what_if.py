"""The section "What if": numbers of the data sheet to be changed on the page, and the covariance that follows."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from mcnav.analysis.changeable_campaign import MARK, ChangeableCampaign
from mcnav.analysis.what_if import LimitedErrors, WhatIf
from mcnav.arrays.types import Array
from mcnav.contract.quantities import Output
from mcnav.physics.units import conversion
from mcnav.report.columns.requirements import NamedRequirement, stated
from mcnav.report.document.parts import Folded, Note, Part, Section, Sentence, WhatIfPart
from mcnav.report.format import number
from mcnav.report.names import humanize
from mcnav.report.statements import verdicts
from mcnav.store.manifest import Variable

if TYPE_CHECKING:
    from mcnav.analysis.summary import Summary

LARGEST: Final = 1_200_000
"""Bytes of numbers, beyond which a page would become too large: it has no such section then."""

EXPLANATION: Final = (
    "Move a number of the data sheet, or type another one: the linear covariance follows. Dashed lines, and marks on "
    "sliders and bars, are the campaign's own."
)
SUM: Final = (
    "The covariance is a sum over all causes, and what a number causes grows with its square. The page has these parts "
    "over time and adds them up. Nothing here was simulated."
)
BENT: Final = (
    "Flights of the campaign have shown second and third derivatives of its constant errors. Where by these linear "
    "analysis does not hold, the line is dashed. Save the file and run mcnav lincov --examine, which simulates flights."
)
HELD: Final = (
    "The filter's model and gains stay as they are in the campaign. mcnav sweep and mcnav allocate re-tune the filter."
)
SAMPLED: Final = "Requirements: the bound of the samples, scaled as linear covariance changes"

MEASURED: Final = (
    "The value of a requirement is its linear value, multiplied by what the samples show of the campaign as it is: {}. "
    "It is not simulated: mcnav report --remedies simulates what would help, and mcnav run a file of your own."
)
FAILS: Final = (
    "Linear analysis does not hold {}. What you change here follows linear analysis, and may miss by more: simulate a "
    "change before you rely on it."
)

GATES: Final = (
    "{}. So what you change here shows sigmas without rejections, and judges no requirement: run a changed campaign."
)

SAVED: Final = (
    "Copy as TOML gives the whole campaign file with the changed numbers. Save it {} for mcnav lincov or mcnav run."
)
BANDS: Final = "A band on a slider is the range that the file gives."
GRADES: Final = "Letters below a slider are grades of the catalogue: {}; click one to take its value."
UNSIZED: Final = "No number of the file sizes {}; what they cause stays as it is."
SEVERAL: Final = "Errors that are correlated keep their correlations."
STEPS: Final = (
    "Derivatives of a closed loop are differences whose steps follow the sizes. Where its maps are not smooth, mcnav "
    "lincov of the copied file differs."
)


def where_nonlinear(summary: Summary) -> str:
    """Say where linear analysis does not hold, in some output or in all together: in this run; empty where it does."""
    return {"differs": "in this run", "partly": "of all outputs together; every sigma is right"}.get(
        verdicts.tone(summary), ""
    )


def what_if_section(
    what_if: WhatIf | None, outputs: Sequence[Output | Variable], loop: bool = False, fails: str = ""
) -> Section | None:
    """Return the section; none where there is nothing to change, or too much for a page.

    Parameters
    ----------
    outputs : sequence of Output or Variable
        Of the scenario.
    loop : bool
        Whether it is a closed loop.
    fails : str
        Where linear analysis does not hold, such as ``in this run``; empty where it does.
    """
    if what_if is None:
        return None
    part = WhatIfPart(_json(what_if, outputs))
    if len(part.json) > 2 * LARGEST:
        return None
    warned = [Note(FAILS.format(fails))] if fails else []
    if what_if.gates:
        warned.append(Note(GATES.format(what_if.gates)))
    return Section("what-if", "What if", [*warned, *_words(what_if, loop), part])


def _words(what_if: WhatIf, loop: bool) -> list[Part]:
    campaign, covariance = what_if.campaign, what_if.covariance
    graded = {name: None for slider in campaign.sliders for name, _ in slider.grades}
    held = covariance.own is not None or bool(campaign.beliefs)
    letters = ", ".join(f"{name[0].upper()} {name}" for name in graded)
    said = [
        SUM,
        BENT if what_if.bends else "",
        MEASURED.format(_factors(what_if.known_scales)) if what_if.scales else "",
        HELD if held else "",
        SEVERAL if covariance.crossed else "",
        UNSIZED.format(", ".join(map(humanize, what_if.unsized))) if what_if.unsized else "",
        STEPS if loop else "",
        SAVED.format(what_if.beside),
    ]
    banded = BANDS if what_if.bands else ""
    above = " ".join(filter(None, (EXPLANATION, banded, GRADES.format(letters) if graded else "")))
    return [Note(above), Folded("How it is computed", [Sentence(" ".join(filter(None, said)))], explains=True)]


def _factors(scales: Sequence[float]) -> str:
    """List the factors of requirements, of more than three the ends.

    >>> _factors([1.0, 1.05]), _factors([1.02, 0.998, 1.12, 1.05])
    ('× 1.00, × 1.05', '× 0.998 to × 1.12')
    """
    if len(scales) > 3:
        return " to ".join(f"× {number(scale, 3)}" for scale in (min(scales), max(scales)))
    return ", ".join(f"× {number(scale, 3)}" for scale in scales)


def _json(what_if: WhatIf, outputs: Sequence[Output | Variable]) -> str:
    """Return what the script reads; sums of single precision are good to 1e-7, but where terms cancel."""
    campaign, covariance = what_if.campaign, what_if.covariance
    wide = covariance.crossed
    pack = _Packing(wide)
    units = {output.name: (conversion(output.unit, output.shown_in), output.shown_in) for output in outputs}
    words, _, unit = covariance.label.partition(" [")
    moved = bool(covariance.nominal.any())
    content = {
        "wide": wide,
        "readings": len(covariance.times),
        "label": words,
        "timeUnit": unit.removesuffix("]"),
        "times": [float(f"{time:.9g}") for time in covariance.times[:-1]],
        "outputs": [
            {
                "name": humanize(output.name),
                "unit": output.shown_in,
                "scale": units[output.name][0],
                "limit": output.limit,
            }
            for output in outputs
        ],
        "entries": covariance.entries,
        "nominal": pack(covariance.nominal) if moved else None,
        "terms": [[term.first, term.second, pack(term.values)] for term in covariance.terms],
        "means": [[number, pack(mean)] for number, mean in covariance.means.items()],
        "own": None if covariance.own is None else pack(covariance.own),
        "bends": [[term.first, term.second, pack(term.values)] for term in what_if.bends],
        "departure": what_if.departure,
        "requirements": [
            _requirement(errors, outputs, units, scale)
            for errors, scale in zip(what_if.requirements, what_if.known_scales, strict=True)
        ],
        "sampled": bool(what_if.scales),
        "basis": SAMPLED if what_if.scales else "Requirements, for linear normal errors",
        **_file(campaign, what_if.bands),
    }
    text = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


class _Packing:
    """Arrays as text: base64 of little-endian numbers."""

    def __init__(self, wide: bool) -> None:
        self._kind = "<f8" if wide else "<f4"

    def __call__(self, values: Array) -> str:
        with np.errstate(over="ignore", under="ignore"):
            return base64.b64encode(np.ascontiguousarray(values, dtype=self._kind).tobytes()).decode()


def _requirement(
    limited: LimitedErrors, outputs: Sequence[Output | Variable], units: dict[str, tuple[float, str]], measured: float
) -> dict[str, object]:
    required = limited.requirement
    names = [outputs[place].name for place in required.outputs]
    named = NamedRequirement(required.kind, names, required.limits, required.probability, required.when,
                             required.about)  # fmt: skip
    scale, unit = units[names[0]]
    return {
        "words": stated(named, units),
        "kind": required.kind,
        "members": limited.members,
        "origin": limited.origin.tolist() if limited.origin.any() else None,
        "limits": required.limits,
        "probability": 0.5 if required.probability is None else required.probability,
        "readings": limited.readings,
        "scale": scale,
        "unit": unit,
        "measured": measured,
    }


def _file(campaign: ChangeableCampaign, bands: Mapping[str, tuple[float, float]]) -> dict[str, object]:
    def plain(items: Iterable[tuple[object, ...]]) -> list[list[object]]:
        return [list(item) for item in items]

    return {
        "mark": MARK,
        "text": campaign.text,
        "tuned": bool(campaign.beliefs),
        "beliefs": plain(
            (".".join(belief.table), belief.key, belief.value, belief.number) for belief in campaign.beliefs
        ),
        "sliders": [
            {
                "path": slider.path,
                "sizes": plain((size.value, size.unit) for size in slider.sizes),
                "shown": slider.shown,
                "axes": slider.axes,
                "grades": plain(slider.grades),
                **({"band": bands[slider.path]} if slider.path in bands else {}),
            }
            for slider in campaign.sliders
        ],
    }
