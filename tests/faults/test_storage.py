"""Disks that are full, folders that cannot be written, chunks with one wrong byte, kills: resumed to the same bits."""

from __future__ import annotations

import random
import shutil
import signal
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from mcnav.config.read import parse_campaign, read_campaign
from mcnav.errors import RunFolderError
from mcnav.execution.progress import Silent
from mcnav.runner.chunks import simulate_chunk
from mcnav.store.chunk_files import verify_chunk
from mcnav.store.run_files import MANIFEST, as_text, json_digest
from mcnav.store.run_folder import RunFolder
from mcnav.workflow.analyse import report_run
from mcnav.workflow.run import run_campaign
from tests.commands import invoke
from tests.faults.remains import digests, left_of
from tests.faults.scenarios import SINGLE, VECTORISED, OnAdvance, as_nobody, command, environment, write_campaign
from tests.processes import LONG, run_to_end, running, wait_for
from tests.runs import simulate

POSITIONS = 2_000


def limited(kind: str, most: int) -> None:
    """In the process that is to be: what it may take."""
    import resource

    resource.setrlimit(getattr(resource, kind), (most, most))
    if kind == "RLIMIT_FSIZE":
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)


CRUISE = {"type": "cruise", "speed": "250 m/s", "duration": "10 min", "altitude": "10 km"}
SMALL = {"scenario": CRUISE, "errors": {"misalignment": "1 mrad", "gyro_drift": "0.1 deg/h"}, "seed": 1}


def small(samples: int, **more: object):  # type: ignore[no-untyped-def]
    """A campaign that takes a second."""
    return parse_campaign(SMALL | {"samples": samples} | more, "test.toml", "test")


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("finished") / "run"
    run_campaign(small(300), folder, "ensemble", 1, report=False)
    return folder


def test_every_wrong_byte_of_a_chunk_is_noticed_and_mended(finished: Path, tmp_path: Path) -> None:
    """At two thousand positions, any other byte: the chunk is not believed; a run names it and flies it again."""
    chance = random.Random(1)
    shutil.copytree(finished, tmp_path / "run")
    folder = RunFolder(tmp_path / "run")
    path = folder.chunk_folder / "part-00000.parquet"
    whole = path.read_bytes()
    identity = _identity(folder)
    assert verify_chunk(folder.chunk_folder, 0, identity) is not None
    for position in chance.sample(range(len(whole)), min(POSITIONS, len(whole))):
        damaged = bytearray(whole)
        damaged[position] ^= chance.randrange(1, 256)
        path.write_bytes(damaged)
        assert verify_chunk(folder.chunk_folder, 0, identity) is None, position
    with pytest.raises(RunFolderError, match=r"part-00000\.parquet: is damaged \(its checksum differs\)"):
        report_run(folder.path)
    mended = run_campaign(small(300), folder.path, "ensemble", 1, report=False)
    assert mended.simulated == 300
    assert mended.notices == (f"{path}: is damaged; its samples are flown again",)
    assert path.read_bytes() == whole


def _identity(folder: RunFolder) -> str:
    from mcnav.store.chunk_files import identities_in

    (identity,) = identities_in(folder.chunk_folder)
    return identity


def test_every_wrong_byte_of_a_manifest_is_noticed_and_mended(finished: Path, tmp_path: Path) -> None:
    """Also one that changes nothing that the manifest says."""
    chance = random.Random(2)
    shutil.copytree(finished, tmp_path / "run")
    folder = RunFolder(tmp_path / "run")
    path = folder.path / "manifest.json"
    whole = path.read_bytes()
    for position in chance.sample(range(len(whole)), min(POSITIONS, len(whole))):
        damaged = bytearray(whole)
        damaged[position] ^= chance.randrange(1, 256)
        path.write_bytes(damaged)
        with pytest.raises(RunFolderError, match=r"manifest\.json: is damaged"):
            folder.manifest()
    mended = simulate(small(300), folder.path, "ensemble", 1)
    assert mended.simulated == 0
    assert len(mended.notices) == 1
    assert "manifest.json: was damaged" in mended.notices[0]
    assert digests(folder.path) == digests(finished)


def test_partials_over_time_that_are_damaged_are_noticed_and_mended(finished: Path, tmp_path: Path) -> None:
    shutil.copytree(finished, tmp_path / "run")
    path = tmp_path / "run" / "development.parquet"
    for content in (path.read_bytes()[:-1] + b"?", b"", None):
        path.unlink() if content is None else path.write_bytes(content)
        with pytest.raises(RunFolderError, match=r"development\.parquet: is missing or damaged"):
            report_run(tmp_path / "run")
    assert simulate(small(300), tmp_path / "run", "ensemble", 1).simulated == 0
    assert digests(tmp_path / "run") == digests(finished)


def test_a_run_of_an_earlier_version_has_partials_over_time_in_its_manifest(finished: Path, tmp_path: Path) -> None:
    shutil.copytree(finished, tmp_path / "run")
    folder = RunFolder(tmp_path / "run")
    manifest = folder.finished_manifest()
    content, known = manifest.to_json(), manifest.model.development
    assert known is not None
    del content["model"]["development_sha256"]
    content["model"]["development"] = known.to_json()
    folder.write(MANIFEST, as_text(content | {"checksum": json_digest(content)}))
    (folder.path / "development.parquet").unlink()
    again = folder.finished_manifest().model.development
    assert again is not None
    assert again.to_json() == known.to_json()


@pytest.mark.posix
@pytest.mark.parametrize(("kind", "most"), [("RLIMIT_FSIZE", 30_000), ("RLIMIT_AS", 6_000_000_000)])
def test_a_full_disk_and_little_memory(kind: str, most: int, tmp_path: Path) -> None:
    """One line that says which it was; afterwards the run goes on to the same bits."""
    body, code = ("", SINGLE) if kind == "RLIMIT_FSIZE" else ("np.ones(900_000_000) if len(a) > 90 else 0", VECTORISED)
    path = write_campaign(tmp_path, body, code, samples=100)
    arguments = ["run", path, "--samples", 2_000, "--jobs", 1, "--out"]
    one_thread = environment() | {"OMP_NUM_THREADS": "1"}
    stopped = run_to_end(command(*arguments, tmp_path / "run"), env=one_thread, preexec_fn=lambda: limited(kind, most))
    assert stopped.returncode == 2, stopped.stderr[-2000:]
    (line,) = stopped.stderr.splitlines()
    assert "File too large" in line if kind == "RLIMIT_FSIZE" else "memory" in line, line
    assert not list((tmp_path / "run").rglob(".*.tmp"))
    if kind == "RLIMIT_AS":
        return
    for place in ("run", "other"):
        done = invoke(*arguments, tmp_path / place, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    assert digests(tmp_path / "run") == digests(tmp_path / "other")


HANGS = {"beside": "abs(a) > 0.5", "samples": "abs(a - FIRST) < 1e-12"}
"""Where a sample hangs: on the side, where derivatives are taken; or only when the first sample itself is flown."""


@pytest.mark.posix
@pytest.mark.parametrize(
    ("name", "times", "place", "jobs"),
    [
        ("SIGINT", 1, "beside", 1),
        ("SIGTERM", 1, "samples", 1),
        ("SIGINT", 2, "samples", 2),
        ("SIGKILL", 1, "beside", 1),
    ],
)
def test_signals_while_a_sample_hangs(name: str, times: int, place: str, jobs: int, tmp_path: Path) -> None:
    """The first signal breaks off in order, a second one at once; neither waits for the sample, and nobody is left."""
    calm = read_campaign(write_campaign(tmp_path / "calm", "", samples=100))
    first = float(calm.errors.draw("random", 1, 100, 0, 1)[0, 0])
    hanging = tmp_path / "hanging"
    body = f"if {HANGS[place]}:\n    open({str(hanging)!r}, 'w').close()\n    time.sleep(100_000)"
    path = write_campaign(tmp_path, body.replace("FIRST", repr(first)), samples=100)
    with running(command("run", path, "--jobs", jobs, "--out", tmp_path / "run"), env=environment()) as process:
        wait_for(hanging.exists, process)
        for _ in range(times):
            process.send_signal(signal.Signals[name])
            time.sleep(0.02)
        _, said = process.communicate(timeout=LONG)
        assert left_of(process.pid) == []
    assert process.returncode == {"SIGINT": 130, "SIGTERM": 143, "SIGKILL": -9}[name]
    if times == 1 and name != "SIGKILL":
        assert said == "error: interrupted; stored samples are kept, and the same command resumes the run\n"
    assert "Traceback" not in said


@pytest.mark.parametrize("written", range(4))  # manifest, history, campaign, code
def test_a_run_that_ends_while_it_begins_is_resumed(written: int, tmp_path: Path) -> None:
    """Whatever is there of a user's campaign when its process ends, the folder is that of a run."""
    run = read_campaign(write_campaign(tmp_path, "", VECTORISED, samples=20))
    write, names = RunFolder.write, list[str]()

    def write_some(folder: RunFolder, name: str, content: bytes) -> None:
        if len(names) == written:
            raise KeyboardInterrupt
        names.append(name)
        write(folder, name, content)

    with patch.object(RunFolder, "write", write_some), pytest.raises(KeyboardInterrupt):
        simulate(run, tmp_path / "run", None, 1)
    assert {path.name for path in (tmp_path / "run").iterdir() if path.is_file()} == {*names, ".lock"}
    assert simulate(run, tmp_path / "run", None, 1).simulated == 20


def test_stale_files_are_swept(finished: Path, tmp_path: Path) -> None:
    shutil.copytree(finished, tmp_path / "run")
    stale = tmp_path / "run" / "samples" / ".part-00001.parquet.0123456789ab.tmp"
    stale.write_bytes(b"half")
    assert simulate(small(300), tmp_path / "run", "ensemble", 1).simulated == 0
    assert not stale.exists()


def test_what_a_worker_leaves_is_gone_at_the_end(tmp_path: Path) -> None:
    """One that is killed amid a run that goes on to its end."""
    left = tmp_path / "run" / "samples" / ".part-00001.parquet.0123456789ab.tmp"
    progress = OnAdvance(lambda: left.write_bytes(b"half"))
    assert run_campaign(small(300), tmp_path / "run", "ensemble", 1, progress=progress, report=False).simulated == 300
    assert not left.exists()


@pytest.mark.posix
def test_a_read_only_folder(finished: Path) -> None:
    """One line, and what is stored there is untouched."""
    with TemporaryDirectory() as place:
        Path(place).chmod(0o755)
        run = Path(place) / "run"
        shutil.copytree(finished, run)
        run.chmod(0o555)
        try:
            with as_nobody(), pytest.raises(RunFolderError, match="cannot be written"):
                simulate(small(400), run, "ensemble", 1)
        finally:
            run.chmod(0o755)
        assert digests(run) == digests(finished)


@pytest.mark.posix
def test_a_folder_that_is_being_read_only_is_told(tmp_path: Path) -> None:
    """Where not even the owner of everything may write."""
    with pytest.raises(RunFolderError, match="cannot be written to"):
        simulate(small(300), Path("/proc/mcnav"), "ensemble", 1)


def test_two_processes_on_one_folder(tmp_path: Path) -> None:
    """One flies; the other is told so, with exit status 4, and touches nothing."""
    go = tmp_path / "go"
    calm = read_campaign(write_campaign(tmp_path, "", samples=300))
    first_drawn = float(calm.errors.draw("random", 1, 300, 0, 1)[0, 0])
    body = f"while {HANGS['samples']} and not os.path.exists({str(go)!r}): time.sleep(0.01)"
    path = write_campaign(tmp_path, body.replace("FIRST", repr(first_drawn)), samples=300)
    arguments = ("run", path, "--jobs", 1, "--out", tmp_path / "run")
    with running(command(*arguments), env=environment()) as first:
        wait_for((tmp_path / "run" / "manifest.json").exists, first)
        second = invoke(*arguments, cwd=tmp_path)
        go.touch()
        _, said = first.communicate(timeout=LONG)
    assert first.returncode == 0, said
    assert second.returncode == 4
    assert "another mcnav is writing here" in second.stderr
    assert invoke("run", path, "--out", tmp_path / "calm", cwd=tmp_path).returncode == 0
    assert digests(tmp_path / "run") == digests(tmp_path / "calm")


def flown(samples: int, folder: Path, **more: Any) -> None:
    """Run the small campaign, in this process and without its page, neither of which is at stake."""
    alone = lambda work, missing, jobs: (simulate_chunk(work, place) for place in missing)  # noqa: E731
    with (
        patch("mcnav.report.pages.run.page.render", return_value=""),
        patch("mcnav.runner.runner.run_in_processes", alone),
    ):
        run_campaign(small(samples), folder, "reference", 1, **more)


class Stopped(Exception):
    """A run that was broken off."""


class Sequences(RuleBasedStateMachine):
    """Runs, kills amid a run, damage and extensions in any order: every finished run is what one flown at once is."""

    def __init__(self) -> None:
        super().__init__()
        self.samples = 0
        self.sound = False
        self.folder = Path()

    @initialize(place=st.just(None))
    def begin(self, place: None) -> None:
        import tempfile

        self.holder = tempfile.TemporaryDirectory()
        self.folder = Path(self.holder.name) / "run"

    def teardown(self) -> None:
        if hasattr(self, "holder"):
            self.holder.cleanup()

    @rule(more=st.sampled_from([0, 1, 31, 32, 40]))
    def run(self, more: int) -> None:
        self.samples = max(64, self.samples + more)
        flown(self.samples, self.folder)
        self.sound = True

    @rule(more=st.sampled_from([0, 33]), after=st.integers(1, 3))
    def broken_off(self, more: int, after: int) -> None:
        """As a kill does: amid the flights, with nothing tidied up."""
        self.samples = max(64, self.samples + more)
        left = [after]

        class Stop(Silent):
            def advance(self, samples: int, stored: bool = False) -> None:
                left[0] -= 1
                if left[0] <= 0:
                    raise Stopped

        try:
            flown(self.samples, self.folder, progress=Stop())
        except Stopped:
            self.sound = False
            (self.folder / "samples" / ".part-00000.parquet.0123456789ab.tmp").write_bytes(b"half")

    @precondition(lambda self: self.samples > 0)
    @rule(which=st.integers(0, 3), place=st.floats(0.0, 0.999), lost=st.booleans())
    def damaged(self, which: int, place: float, lost: bool) -> None:
        parts = sorted((self.folder / "samples").glob("part-*.parquet"))
        if not parts:
            return
        path = [*parts, self.folder / "manifest.json"][which % (len(parts) + 1)]
        whole = bytearray(path.read_bytes())
        whole[int(place * len(whole))] ^= 0x55
        path.write_bytes(whole)
        if lost:
            path.unlink()
        self.sound = False

    @precondition(lambda self: self.samples > 64)
    @rule()
    def fewer(self) -> None:
        """A step back is refused, unless nobody can know that it is one."""
        manifest = self.folder / "manifest.json"
        try:
            known = RunFolder(self.folder).manifest() is not None
        except RunFolderError:
            known = False
        if known and manifest.exists():
            with pytest.raises(RunFolderError, match="are fewer"):
                flown(self.samples - 1, self.folder)

    @invariant()
    def as_at_once(self) -> None:
        if self.sound:
            assert digests(self.folder) == at_once(self.samples)


AT_ONCE: dict[int, dict[str, str]] = {}


def at_once(samples: int) -> dict[str, str]:
    """Digests of a run that nothing happened to."""
    import tempfile

    if samples not in AT_ONCE:
        with tempfile.TemporaryDirectory() as place:
            flown(samples, Path(place) / "run")
            AT_ONCE[samples] = digests(Path(place) / "run")
    return AT_ONCE[samples]


TestSequences = Sequences.TestCase
TestSequences.settings = settings(
    max_examples=6, stateful_step_count=8, derandomize=True, deadline=None, suppress_health_check=list(HealthCheck)
)
