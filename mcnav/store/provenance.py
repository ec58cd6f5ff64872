"""Origin of the program: the commit of its checkout."""

from __future__ import annotations

from pathlib import Path


def commit(package: Path | None = None) -> str | None:
    """Return the commit of the program's own checkout; none when it is not run from one.

    Git's files are read, not git: there need not be one. A package that was installed into some other project's
    folder is not of that project's commit.

    Parameters
    ----------
    package : Path, optional
        The package's folder; by default that of this program.
    """
    root = (package or Path(__file__).parents[1]).resolve().parent
    try:
        folder = root / ".git"
        if folder.is_file():  # a linked work tree
            folder = root / folder.read_text(encoding="utf-8").removeprefix("gitdir:").strip()
        shared = folder / "commondir"
        common = folder / shared.read_text(encoding="utf-8").strip() if shared.exists() else folder
        head = (folder / "HEAD").read_text(encoding="utf-8").strip()
        name = head.removeprefix("ref: ")
        if name == head:
            return head
        for place in (folder, common):
            if (place / name).exists():
                return (place / name).read_text(encoding="utf-8").strip()
        packed = (common / "packed-refs").read_text(encoding="utf-8").splitlines()
        return next((line.split()[0] for line in packed if line.endswith(f" {name}")), None)
    except OSError:
        return None
