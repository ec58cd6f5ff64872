"""What would help a run, kept in its folder: a report shows it without computing anything."""

from __future__ import annotations

from mcnav.analysis.remedies import Remedies
from mcnav.errors import RunFolderError
from mcnav.store.run_files import REMEDIES, ManifestError, read_json, validate
from mcnav.store.run_folder import RunFolder


def stored_remedies(folder: RunFolder) -> Remedies | None:
    """Read what would help a run; none where nothing fails, or nothing was computed."""
    remedy = "run mcnav report --remedies on the folder"
    read = read_json(folder.path, REMEDIES, remedy)
    if read is None:
        return None
    try:
        return validate(Remedies, *read)
    except ManifestError as fault:
        raise RunFolderError(f"{folder.path / REMEDIES}: is damaged ({fault}); {remedy}") from None


def keep_remedies(folder: RunFolder, remedies: Remedies | None) -> None:
    """Write what would help a run, or delete it where nothing fails."""
    if remedies is None:
        (folder.path / REMEDIES).unlink(missing_ok=True)
    else:
        folder.write_json(REMEDIES, remedies.to_json())
