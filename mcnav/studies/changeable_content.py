"""Entries of a campaign whose numbers can be changed, and where a file of them is to be saved."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from mcnav.config.documents import document_of
from mcnav.config.read import Campaign
from mcnav.config.toml import Content
from mcnav.errors import CampaignError

OF_SIZES: Final = ("imu", "filter", "processes", "measurements")
"""Tables of a campaign file that a campaign has as they are in the file."""


def changeable_content(campaign: Campaign) -> tuple[Content, str]:
    """Return the entries whose numbers can be changed, and where a file of them is to be saved.

    They are those of the campaign's file, or of the campaign where these are others.
    """
    beside = f"beside {Path(campaign.file).name}"
    try:
        content = document_of(campaign).content
    except CampaignError:  # it was read from no file
        content = {}
    names = OF_SIZES if campaign.tables else (*OF_SIZES, "errors")  # columns of tables have other paths there
    if any(content.get(name) != campaign.resolved.get(name) for name in names):
        return dict(campaign.resolved), "beside the files that it names"
    return content, beside
