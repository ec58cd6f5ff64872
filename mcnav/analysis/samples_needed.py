"""Samples that would decide an undecided requirement by counting those beyond its limit, or why none would."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from mcnav.statistics.power import sensible_step
from mcnav.statistics.samples_to_decide import MOST, samples_to_meet, samples_to_reject


@dataclass(frozen=True)
class Counting:
    """Samples that were counted, and how many could be.

    Attributes
    ----------
    samples : int
        Samples of the campaign.
    independent : int
        Those of them that are counted: one of each antithetic pair.
    most : int or None
        Samples that can be counted at most.
    reason : str
        Why no more can be.
    """

    samples: int
    independent: int
    most: int | None = None
    reason: str = ""


def samples_needed(
    beyond: Sequence[float], surely: Sequence[float], allowed: float, confidences: tuple[float, float],
    counting: Counting,
) -> tuple[int | None, str]:  # fmt: skip
    """Return the samples that would decide with a probability of 90 % if the shares were those counted; and a remark.

    Parameters
    ----------
    beyond, surely : sequence of float
        Share of samples beyond the limit at each epoch, failed ones included, and without them.
    allowed : float
        Share that may be.
    confidences : (float, float)
        Those of the bounds above and below.
    """
    share = max(beyond) if max(beyond) < allowed else max(surely)
    close = f"{100.0 * share:.4g} % of the samples lie beyond the limit and {100.0 * allowed:.4g} % may"
    if max(beyond) < allowed:
        draws = samples_to_meet(beyond, allowed, confidences[0])
    elif share > allowed:
        draws = samples_to_reject(surely, allowed, confidences[1])
    elif max(beyond) > allowed:
        return None, "failed samples decide it: counting more would not, unless fewer fail"
    else:
        draws = None
    if draws is None:
        return None, f"{close}: so close that {MOST:,} samples would not decide"
    each = counting.samples / counting.independent
    needed = max(counting.samples + 1, math.ceil(draws * each))
    if counting.most is not None and needed > counting.most:
        return None, f"{counting.reason}; about {sensible_step(needed, counting.samples):,} would decide"
    error = math.sqrt(allowed * (1.0 - allowed) / counting.independent)
    rough = abs(share - allowed) < error
    return needed, f"a rough number: {close}, less than a standard error apart" if rough else ""
