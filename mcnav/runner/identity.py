"""The identity of a run: two runs with the same identity have the same samples, bit for bit.

The number of samples is part of a run's identity, but not of a chunk's: a sample depends on its index alone, as long as
the design's blocks and the probes of the engine stay the same. So a run can be extended.
"""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from typing import Any, Final

from mcnav.compiled.target import target
from mcnav.contract.scenario import Scenario
from mcnav.entries.inputs import InputFile, SourceFile
from mcnav.errors import RunFolderError, shortened
from mcnav.files.whole import to_json
from mcnav.linear.block_sums import block_size
from mcnav.runner.draws import PROBES
from mcnav.sampler.designs import REPLICATES, block_length
from mcnav.store.chunk_files import identities_in
from mcnav.store.manifest import CodeRecord, Identity
from mcnav.store.run_files import MANIFEST, json_digest
from mcnav.store.run_folder import RunFolder
from mcnav.store.summaries import SLOW, SUMMARY, summary_chunk

LIBRARIES: Final = ("numpy", "scipy", "numba", "pyarrow")
CHUNKS: Final = 2
SUMMARY_CHUNKS: Final = 3
"""Versions of the content of a chunk's file: of one with all samples, and of a summary's."""

SHOWN: Final = 3
"""Differences that a refusal names."""

SAMPLES: Final = "samples"

UNUSED: Final = ("start_times", "accept", "sample_timeout")
"""Entries of a campaign on which its samples do not depend, but for the epochs that requirements add."""

REMEDY: Final = "--fresh replaces them, --out writes elsewhere"


def versions() -> dict[str, str]:
    """Return the versions of the program, the interpreter and the libraries that results depend on."""
    return {
        "mcnav": version("mcnav"),
        "python": platform.python_version(),
        **{name: version(name) for name in LIBRARIES},
    }


def identity_of(
    resolved: Mapping[str, Any],
    engine: str,
    code: SourceFile | None,
    inputs: Sequence[InputFile],
    scenario: Scenario,
) -> Identity:
    """Collect what the samples of a resolved campaign depend on; other entries are left out.

    A scenario whose samples have changed in their last digits counts these changes in an attribute ``revision``. One
    with epochs besides its usual ones, for which requirements ask, has them in ``further_epochs``.
    """
    entries = to_json({key: entry for key, entry in resolved.items() if key not in UNUSED})
    chunks = SUMMARY_CHUNKS if entries.get("store") == SUMMARY else CHUNKS
    identity = Identity(campaign=entries, engine=engine, versions=versions(), chunks=chunks)
    return identity.completed(
        {
            "revision": getattr(scenario, "revision", None) or None,
            # chunks of a run made before them do not have their columns
            "later_sources": [source.name for source in scenario.sources if source.later] or None,
            "further_epochs": list(scenario.further_epochs) or None,
            "code": None if code is None else CodeRecord(file=code.file, sha256=code.digest),
            "files": {file.name: file.digest for file in inputs} or None,
        }
    )


@dataclass(frozen=True)
class DrawnRun:
    """A run of so many samples by a design, and what their number decides of each of them."""

    identity: Identity
    design: str
    samples: int

    @property
    def digest(self) -> str:
        """Digest of what the samples depend on, whatever their number: every stored chunk has it."""
        content = self.identity.to_json()
        content["campaign"].pop(SAMPLES, None)
        return json_digest(content | {"drawn": self.drawn} | self.summed)

    @property
    def earlier_digests(self) -> tuple[str, ...]:
        """Digests of the runs of fewer samples whose summaries have blocks half as long, a quarter, and so on.

        The chunks of these, but the last one, are those of this run when their blocks are doubled.
        """
        digests, fewer, double = list[str](), self.of(self.samples // 2), self.of(2 * (self.samples // 2))
        while _can_double(fewer.summed, double.summed) and fewer.drawn == self.drawn:
            digests.append(fewer.digest)
            fewer, double = self.of(fewer.samples // 2), self.of(2 * (fewer.samples // 2))
        return tuple(digests)

    @property
    def drawn(self) -> dict[str, int]:
        """What the number of samples decides of each sample."""
        return {"block": self.block_length, "probes": min(PROBES, self.samples)}

    @property
    def summed(self) -> dict[str, dict[str, int]]:
        """What the number of samples decides of a summary's sums; nothing of stored samples."""
        if self.identity.campaign.get("store") != SUMMARY:
            return {}
        block = block_size(self.samples, self.block_length)
        return {"summed": {"block": block, "chunk": summary_chunk(SLOW, self.samples)}}

    @property
    def block_length(self) -> int:
        """Samples of a block of the design."""
        return block_length(self.design, self.samples)

    def of(self, samples: int) -> DrawnRun:
        """Return the same run with another number of samples."""
        return replace(self, samples=samples)


def _can_double(before: Mapping[str, Mapping[str, int]], now: Mapping[str, Mapping[str, int]]) -> bool:
    """Return whether the blocks of one summary are twice as long as those of another, in chunks of as many samples."""
    if not before:
        return False
    earlier, later = before["summed"], now["summed"]
    return 2 * earlier["block"] == later["block"] and earlier["chunk"] == later["chunk"]


def check_resumable(folder: RunFolder, run: DrawnRun) -> tuple[list[str], str]:
    """Raise `RunFolderError` when a folder holds another run: its results are neither mixed with nor overwritten.

    A damaged manifest is replaced when the chunks beside it are of this very run.

    Returns
    -------
    notices : list of str
        For the user.
    processors : str
        All processors for which code has simulated the run's samples, or does now.
    """
    damage: RunFolderError | None = None
    try:
        earlier = folder.manifest()
    except RunFolderError as failure:
        earlier, damage = None, failure
    if earlier is not None:
        _refuse_changed(folder, earlier.identity, run)
        return _processors(folder, earlier.processor)
    stored = identities_in(folder.chunk_folder)
    if stored - {run.digest, *run.earlier_digests}:
        state = "missing" if damage is None else "damaged"
        raise RunFolderError(
            f"{folder.path}: holds samples of another run, and the {MANIFEST} that would say which is {state}; {REMEDY}"
        )
    if damage is None:
        return [], target()
    notice = f"{folder.path / MANIFEST}: was damaged; it is written again, and stored samples are believed by content"
    return [notice], target()


def _processors(folder: RunFolder, earlier: str | None) -> tuple[list[str], str]:
    """Return a notice where a run has samples by code for another processor than this one's, and all processors."""
    here = target()
    if earlier in (None, here):
        return [], here
    notice = (
        f"{folder.path}: has samples by code for {earlier}, and continues with code for {here}; "
        "samples for different processors may differ in their last digits"
    )
    return [notice], ", ".join(dict.fromkeys([*earlier.split(", "), here]))


def check_no_foreign_files(folder: RunFolder) -> None:
    """Raise `RunFolderError` when a folder holds files but no run of this program."""
    foreign = folder.foreign()
    if not foreign or identities_in(folder.chunk_folder):
        return
    try:
        known = folder.manifest() is not None
    except RunFolderError:
        known = False
    if not known:
        raise RunFolderError(
            f"{folder.path}: holds {foreign[0]!r}, which is not of a run; choose another folder with --out"
        )


def _refuse_changed(folder: RunFolder, earlier: Identity, run: DrawnRun) -> None:
    """Raise `RunFolderError` when the earlier run is neither this one nor the beginning of it."""
    before, now = _flat(earlier.to_json()), _flat(run.identity.to_json())
    changed = [key for key in sorted(before.keys() | now.keys()) if before.get(key) != now.get(key)]
    stored = before.get(SAMPLES)
    if changed == [SAMPLES] and isinstance(stored, int) and isinstance(now.get(SAMPLES), int):
        _refuse_other_samples(folder, run.of(stored), run)
        return
    if changed:
        lines = [f"{key} was {before.get(key, 'absent')}, is {now.get(key, 'absent')}" for key in changed[:SHOWN]]
        more = f" and {len(changed) - SHOWN} more" if len(changed) > SHOWN else ""
        raise RunFolderError(
            f"{folder.path}: holds the results of another run ({shortened('; '.join(lines))}{more}); {REMEDY}"
        )


def _refuse_other_samples(folder: RunFolder, before: DrawnRun, run: DrawnRun) -> None:
    """Raise `RunFolderError` when the samples of a run do not begin with the earlier ones."""
    if run.samples < before.samples:
        fault = f"a run of {before.samples:,} samples, and {run.samples:,} are fewer; ask for as many or more, {REMEDY}"
    elif before.samples < PROBES:
        fault = f"a run of {before.samples} samples; one of fewer than {PROBES} is too short to be extended: {REMEDY}"
    elif before.drawn != run.drawn:
        most = 2 * REPLICATES * before.block_length - 1
        fault = (
            f"a run of {before.samples:,} samples, which design {run.design} would change if there were "
            f"{run.samples:,}; up to {most:,} they stay as they are, {REMEDY}"
        )
    elif before.summed and before.summed["summed"]["chunk"] != run.summed["summed"]["chunk"]:
        fault = f"a summary of {before.samples:,} samples, and one of {run.samples:,} has fewer, longer files; {REMEDY}"
    else:
        return
    raise RunFolderError(f"{folder.path}: holds {fault}")


def _flat(value: Any, prefix: str = "") -> dict[str, object]:
    """Flatten nested tables and lists of tables, with keys as messages have them.

    >>> _flat({"campaign": {"errors": {"altitude": "5 km"}, "aiding": [{"type": "gnss"}]}, "engine": "ensemble"})
    {'errors.altitude': '5 km', 'aiding #1.type': 'gnss', 'engine': 'ensemble'}
    """
    if isinstance(value, Mapping):
        return {key: leaf for name, entry in value.items() for key, leaf in _flat(entry, f"{prefix}{name}.").items()}
    if isinstance(value, list) and value and all(isinstance(entry, Mapping) for entry in value):
        at = prefix.removesuffix(".")
        return {
            key: leaf for number, entry in enumerate(value, 1) for key, leaf in _flat(entry, f"{at} #{number}.").items()
        }
    return {prefix.removesuffix(".").removeprefix("campaign."): value}
