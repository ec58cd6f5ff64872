"""The campaign of a run, read again from its folder or from the file that the run was made of."""

from __future__ import annotations

from pathlib import Path

from mcnav.config.read import Campaign, read_campaign
from mcnav.entries.context import EarlierFile
from mcnav.errors import RunFolderError, reading_file, shortened
from mcnav.execution.threads import one_thread
from mcnav.runner.identity import identity_of
from mcnav.store.manifest import Manifest
from mcnav.store.run_files import CAMPAIGN, MANIFEST
from mcnav.store.run_folder import RunFolder


def campaign_of(folder: RunFolder, manifest: Manifest, file: Path | None) -> tuple[Campaign, str]:
    """Read the campaign of a run and its engine's name; refuse a campaign that is not the run's."""
    then = manifest.identity
    with reading_file(folder.path / MANIFEST):
        given = {key: then.campaign[key] for key in ("samples", "seed")}
    given["store"] = then.campaign.get("store", "samples")
    if file is None:
        folder.campaign()  # refuses a pipe, which may have no end
    path = folder.path / CAMPAIGN if file is None else file
    earlier = {
        record.setting: EarlierFile(record.sha256, folder.copy_of(record) if record.copied else None)
        for record in manifest.files
        if record.setting is not None
    }
    campaign = read_campaign(path, given, execute=file is not None, earlier=earlier)
    with one_thread():
        now = identity_of(campaign.resolved, then.engine, campaign.code, campaign.inputs(), campaign.scenario)
    if (now.campaign, now.code) != (then.campaign, then.code):
        raise RunFolderError(f"{path}: is not the campaign that was flown in {folder.path}")
    changed = next((name for name, _ in sorted(then.files.items() ^ now.files.items())), None)
    if changed is not None:
        change = f"{changed} was {then.files.get(changed, 'absent')}, is {now.files.get(changed, 'absent')}"
        record = next((record for record in manifest.files if record.name == changed and record.copied), None)
        copy = folder.copy_of(record) if record is not None else None
        remedy = "restore the file" if copy is None else f"restore the file from {copy}, or declare it as a setting"
        made = f"{folder.path} was made ({shortened(change)})"
        raise RunFolderError(f"{path}: reads other files than when {made}; {remedy}")
    return campaign, then.engine
