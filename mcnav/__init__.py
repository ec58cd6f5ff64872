"""May the linear covariance analysis of an inertial navigation system be trusted, and where does it stop?

Frames and signs
    Planar motion, east in the equatorial plane of a spherical, rotating earth. Earth-centred polar state
    ``(r, theta, r_dot, theta_dot)``; ``f_x`` horizontal (positive east), ``f_z`` vertical (positive **down**), both
    specific forces. The reference axes of the instruments are horizontal and vertical at the start of navigation.
    Navigation error = indicated - actual.

Units
    SI and radians inside; km, deg/h, ug, ppm and the like in campaign files, tables and reports only.

Order of the error sources (columns of P)
    altitude, range, altitude_rate, range_rate, misalignment, gyro_drift, bias_x, bias_z, scale_factor_x,
    scale_factor_z. Range and range rate are arc lengths at the radius of the start.

Order of the outputs (rows of P)
    altitude, range, altitude_rate, range_rate. Range and range rate are arc lengths at the earth's radius.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mcnav.campaign.file import Campaign, read_campaign
    from mcnav.campaign.problems import CampaignError, RunFolderError
    from mcnav.study import report_run, run_campaign, samples_of, summary_of

_HOMES = {
    "Campaign": "mcnav.campaign.file",
    "CampaignError": "mcnav.campaign.problems",
    "RunFolderError": "mcnav.campaign.problems",
    "read_campaign": "mcnav.campaign.file",
    "report_run": "mcnav.study",
    "run_campaign": "mcnav.study",
    "samples_of": "mcnav.study",
    "summary_of": "mcnav.study",
}

__all__ = [
    "Campaign",
    "CampaignError",
    "RunFolderError",
    "read_campaign",
    "report_run",
    "run_campaign",
    "samples_of",
    "summary_of",
]


def __getattr__(name: str) -> Any:
    """Public names are imported when they are used, so that ``mcnav --help`` need not wait for numerics."""
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'mcnav' has no attribute {name!r}")
