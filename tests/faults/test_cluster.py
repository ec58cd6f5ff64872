"""Chunks flown on a real dask cluster of two worker processes: the same bits as here, whatever becomes of workers."""

from __future__ import annotations

import json
import os
import shutil
import signal
import sys
import time
from collections.abc import Collection, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import replace
from multiprocessing import active_children
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from joblib.externals.loky.backend import resource_tracker
from typer.testing import Result

from mcnav.config.read import read_campaign
from mcnav.errors import ClusterError, RunFolderError, TooManyFailures
from mcnav.execution.progress import SILENT
from mcnav.runner import dask_cluster as clusters
from mcnav.runner.chunks import ChunkJob
from mcnav.runner.dask_cluster import Cluster, connect
from mcnav.runner.runner import run_chunks
from mcnav.store.run_folder import RunFolder
from tests.commands import in_process
from tests.conftest import ROOT, campaign
from tests.faults.kinds import Case
from tests.faults.remains import contents, digests, left_of
from tests.faults.scenarios import VECTORISED, OnAdvance, chunk_job, command, environment, write_campaign
from tests.faults.test_failures import LIMIT, REASONS
from tests.processes import LONG, run_to_end, running, wait_for
from tests.runs import simulate
from tests.worker_server import used_by_dask

POISON = ("os._exit(9)", "time.sleep(60)")


@pytest.fixture(scope="module", autouse=True)
def forked_workers_of_dask() -> Iterator[None]:
    with used_by_dask():
        yield


@pytest.fixture(scope="module")
def cluster() -> Iterator[Cluster]:
    with connect(None, 2) as (made, notices):
        assert made.threads == 2
        assert notices == []
        yield made


def workers(cluster: Cluster) -> set[int]:
    return set(cluster.client.run(os.getpid).values())


def mcnav_run(*arguments: object) -> Result:
    return in_process("run", *arguments)


@pytest.mark.parametrize("where", ["executed", "flown"])
def test_a_file_that_a_scenario_reads(where: str, cluster: Cluster, tmp_path: Path) -> None:
    """Workers that outlive a run take the next one's file; identity and chunks are those of a run without a cluster."""
    table = tmp_path / "table.txt"
    read = f"float(np.loadtxt({str(table)!r}))"
    body = f"self.gain = getattr(self, 'gain', None) or {read}" if where == "flown" else "self.gain = GAIN"
    code = VECTORISED.replace("class Mine", f"GAIN = {read}\n\nclass Mine" if where == "executed" else "class Mine")
    table.write_text("2")
    path = write_campaign(tmp_path, body, code.replace("2.0 * a", "self.gain * a"))
    for gain in (2.0, 3.0):
        table.write_text(f"{gain:g}")
        for folder, flyers in (("here", None), ("there", cluster.simulate)):
            simulate(read_campaign(path), tmp_path / folder, None, 2, fresh=True, executor=flyers)
        here, there = (RunFolder(tmp_path / folder).manifest() for folder in ("here", "there"))
        assert here is not None
        assert there is not None
        assert here.identity == there.identity
        assert here.identity.files.keys() == {"table.txt"}
        assert digests(tmp_path / "here") == digests(tmp_path / "there")
        samples = pd.read_parquet(tmp_path / "there" / "samples")
        np.testing.assert_allclose(samples["output b [m]"], gain * samples["error a [m]"], rtol=1e-15)

    path.write_text(path.read_text().replace("samples = 100", "samples = 30_000"))  # four chunks
    with pytest.raises(RunFolderError, match=r"table\.txt: has changed; samples stored in"):
        simulate(
            read_campaign(path),
            tmp_path / "there",
            None,
            2,
            progress=OnAdvance(lambda: table.write_text("4")),
            executor=cluster.simulate,
        )


@pytest.mark.parametrize(("engine", "store"), [("ensemble", "samples"), ("ensemble", "summary"), ("map", "samples")])
def test_same_bits(engine: str, store: str, cluster: Cluster, tmp_path: Path) -> None:
    run = campaign(1, samples=20_000, store=store)
    work = chunk_job(run, tmp_path / "here", engine)
    there = replace(work, folder=RunFolder(tmp_path / "there"))
    there.folder.chunk_folder.mkdir(parents=True)
    _, flown = run_chunks(work, 1, SILENT)
    parts, flown_there = run_chunks(there, 2, SILENT, executor=cluster.simulate)
    assert flown == flown_there == sum(part.end - part.begin for part in parts) == run.samples
    assert digests(tmp_path / "here") == digests(tmp_path / "there")
    assert run_chunks(there, 2, SILENT, executor=cluster.simulate)[1] == 0


def test_a_whole_run(cluster: Cluster, tmp_path: Path) -> None:
    """Its folder is the same, but for times; a stopping rule flies several times."""
    shutil.copy(ROOT / "campaigns" / "polar.py", tmp_path)
    (tmp_path / "polar.toml").write_text((ROOT / "campaigns" / "14_polar.toml").read_text())
    for name, options in (("here", ("--jobs", 1)), ("there", ("--scheduler", cluster.address))):
        done = mcnav_run(tmp_path / "polar.toml", "--samples", 40_000, "--out", tmp_path / name, *options)
        assert done.exit_code == 0, done.output
        assert done.stderr == ""
    assert digests(tmp_path / "here") == digests(tmp_path / "there")
    assert (tmp_path / "there" / "summary.json").read_bytes() == (tmp_path / "here" / "summary.json").read_bytes()
    assert json.loads((tmp_path / "there" / "manifest.json").read_text())["flight"]["jobs"] == 2


@pytest.mark.parametrize("together", [1, 5])
def test_a_killed_worker(together: int, cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In mid-campaign; there are more chunks, alone or several together, than are handed out at once."""
    monkeypatch.setattr(clusters, "SHARES", 30 // together)
    cluster.client.wait_for_workers(2)
    code = VECTORISED.replace("def propagate", "chunk = 5\n\n    def propagate")
    work = chunk_job(read_campaign(write_campaign(tmp_path, "time.sleep(0.05)", code, samples=300)), tmp_path / "here")
    there = replace(work, folder=RunFolder(tmp_path / "there"))
    there.folder.chunk_folder.mkdir(parents=True)
    run_chunks(work, 4, SILENT)
    ready, before = [0], workers(cluster)

    def kill() -> None:
        ready[0] += 1
        if ready[0] == 3:
            os.kill(min(workers(cluster)), signal.SIGKILL)

    assert run_chunks(there, 2, OnAdvance(kill), executor=cluster.simulate)[1] == 300
    assert ready[0] == 60
    assert digests(tmp_path / "here") == digests(tmp_path / "there")
    assert workers(cluster) != before


def test_a_killed_worker_of_an_aided_run(cluster: Cluster, tmp_path: Path) -> None:
    """Amid chunks; all files of the run are those of one without a cluster."""
    cluster.client.wait_for_workers(2)
    case, killed, before = Case("aided, own gains", "summary"), list[int](), workers(cluster)

    def kill() -> None:
        if not killed:
            killed.append(min(before))
            os.kill(killed[0], signal.SIGKILL)

    case.run(tmp_path, tmp_path / "here")
    case.run(tmp_path, tmp_path / "there", progress=OnAdvance(kill), executor=cluster.simulate)
    assert contents(tmp_path / "here") == contents(tmp_path / "there")
    assert killed[0] not in workers(cluster)


def test_a_chunk_that_always_kills_its_worker(cluster: Cluster, tmp_path: Path) -> None:
    """It does not hang: dask gives up, and the one sample at fault is found, as for any deadly sample."""
    calm = read_campaign(write_campaign(tmp_path / "calm", "", VECTORISED, samples=100))
    value = float(calm.errors.draw("random", 1, 100, 0, 100)[17, 0])
    code = VECTORISED.replace("import time", "import os").replace("def prop", "chunk = 10\n\n    def prop")
    path = write_campaign(tmp_path / "hit", f"if (a == {value!r}).any(): os._exit(9)", code)
    run_chunks(chunk_job(calm, tmp_path / "calm" / "run"), 1, SILENT)
    done = mcnav_run(path, "--scheduler", cluster.address, "--out", tmp_path / "hit" / "run")
    assert done.exit_code == 3, done.output
    assert "1 of 100 samples failed" in " ".join(done.output.split())
    hit, other = (pd.read_parquet(tmp_path / name / "run" / "samples") for name in ("hit", "calm"))
    assert [*np.flatnonzero(hit["status"] != "ok")] == [17]
    assert hit["status"][17] == "failed: the worker process died while flying it"
    pd.testing.assert_frame_equal(hit.drop(17), other.drop(17), check_exact=True)


def test_poison_samples_fail_alone(cluster: Cluster, tmp_path: Path) -> None:
    """Flown in processes of their own they do not even end the worker; the limit of time holds."""
    calm = read_campaign(write_campaign(tmp_path / "calm", "", samples=60))
    drawn = calm.errors.draw("random", 1, 60, 0, 60)[:, 0]
    chosen = dict(zip(np.sort(drawn)[: len(POISON)].tolist(), POISON, strict=True))
    body = "\n".join(f"if a == {value!r}:\n    {act}" for value, act in chosen.items())
    run = read_campaign(write_campaign(tmp_path / "hit", body, samples=60, more=LIMIT))
    cluster.client.wait_for_workers(2)
    before, work = workers(cluster), chunk_job(run, tmp_path / "run")
    assert run_chunks(work, 2, SILENT, executor=cluster.simulate)[1] == 60
    samples = pd.read_parquet(tmp_path / "run" / "samples")
    expected = [f"failed: {REASONS[chosen[value]]}" if value in chosen else "ok" for value in drawn.tolist()]
    assert samples["status"].tolist() == expected
    outputs = np.column_stack([2.0 * drawn, drawn + drawn**2])
    outputs[[value in chosen for value in drawn.tolist()]] = np.nan
    np.testing.assert_array_equal(samples.filter(like="output"), outputs)
    assert workers(cluster) == before
    assert not list((tmp_path / "run").rglob(".*.tmp"))


def test_a_cluster_that_is_lost(cluster: Cluster, tmp_path: Path) -> None:
    """One line, at once; what is stored is kept."""
    code = VECTORISED.replace("def propagate", "chunk = 5\n\n    def propagate")
    work = chunk_job(read_campaign(write_campaign(tmp_path, "time.sleep(0.02)", code, samples=300)), tmp_path / "run")
    with connect(cluster.address, 1) as (lost, _):
        ready = [0]

        def lose() -> None:
            ready[0] += 1
            if ready[0] == 2:
                lost.client.close()

        with pytest.raises(ClusterError, match=r"the scheduler is gone.*the same command goes on from there"):
            run_chunks(work, 1, OnAdvance(lose), executor=lost.simulate)
    assert 0 < len(digests(tmp_path / "run")) < 60


def test_a_cluster_without_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    class Deserted:
        status = "running"

        def nthreads(self) -> dict[str, int]:
            return {}

    monkeypatch.setattr(clusters, "PATIENCE", 0.0)
    with pytest.raises(ClusterError, match="tcp://there: has had no worker for 0 s"):
        Cluster(Deserted(), "tcp://there")._look(())


def test_refusals(cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One line each, exit status 2, nothing flown."""
    path = write_campaign(tmp_path, "")
    there = ("--scheduler", cluster.address)

    def refused(*arguments: object) -> str:
        done = mcnav_run(path, "--out", tmp_path / "run", *arguments)
        assert done.exit_code == 2, done.output
        assert len(done.stderr.splitlines()) == 1
        assert not digests(tmp_path / "run")
        return done.stderr

    assert "give one of them" in refused("--dask", 2, *there)
    assert "--jobs counts workers without a cluster" in refused("--dask", 2, "--jobs", 2)
    assert "--jobs counts workers without a cluster" in refused("--jobs", 2, *there)
    assert "is no scheduler that can be used" in refused("--scheduler", "nonsense://x")
    with monkeypatch.context() as patch:
        patch.setattr(clusters, "ANSWERS", 0.5)
        assert "tcp://127.0.0.1:9: is no scheduler" in refused("--scheduler", "tcp://127.0.0.1:9")
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "distributed", None)
        assert "pip install 'mcnav[dask]'" in refused("--dask", 1)
    with monkeypatch.context() as patch:
        other = clusters.versions() | {"numpy": "0.1"}
        patch.setattr(clusters, "versions", lambda: other)
        assert "where this run has numpy 0.1; its results would be others" in refused(*there)
    with monkeypatch.context() as patch:

        @contextmanager
        def elsewhere(work: ChunkJob) -> Iterator[ChunkJob]:
            yield replace(work, wanted=Path("/nowhere/samples/.wanted"))

        patch.setattr(clusters, "_wanted", elsewhere)
        assert "does not see /nowhere/samples; the run folder must be shared" in refused(*there)


def _kill_first_child(others: Collection[Any]) -> None:
    first = wait_for(lambda: [child.pid for child in active_children() if child not in others and child.pid])[0]
    os.kill(first, signal.SIGKILL)


def test_a_worker_that_ends_before_it_is_ready(tmp_path: Path) -> None:
    """One line; the campaign is not begun, and nobody is left."""
    path, before = write_campaign(tmp_path, ""), active_children()
    with ThreadPoolExecutor(1) as threads:
        killed = threads.submit(_kill_first_child, before)
        done = mcnav_run(path, "--dask", 2, "--out", tmp_path / "run")
        killed.result()
    assert done.exit_code == 2, done.output
    assert done.stderr.startswith("error: --dask 2: the cluster could not be started: ")
    assert done.stderr.endswith("; the same command tries again, fewer workers need less memory\n")
    assert done.stderr.count("\n") == 1
    assert set(active_children()) <= set(before)
    assert not (tmp_path / "run").exists()


def test_the_library_is_imported_for_clusters_alone() -> None:
    code = "import sys, mcnav.workflow.run, mcnav.runner.dask_cluster; sys.exit('distributed' in sys.modules)"
    assert run_to_end([sys.executable, "-c", code], env=environment()).returncode == 0


def test_a_chunk_that_nobody_wants_any_more(cluster: Cluster, tmp_path: Path) -> None:
    """A worker that is still flying when the run is broken off does not write into what may be another run's folder."""
    code = VECTORISED.replace("import time", "import os, time").replace(
        "def propagate", "chunk = 50\n\n    def propagate"
    )
    late, go = str(tmp_path / "late"), str(tmp_path / "go")
    body = f"""
    if len(a) == 50:  # the chunk that comes first waits, the others fail
        try:
            with open({late!r}, "x") as file: file.write(str(os.getpid()))
            while not os.path.exists({go!r}): time.sleep(0.01)
        except FileExistsError:
            a = a * np.nan
    """
    run = read_campaign(write_campaign(tmp_path, body, code, samples=400))
    work = chunk_job(run, tmp_path / "run")
    with pytest.raises(TooManyFailures, match=r"50 of the .* samples flown so far failed, where 49 may"):
        run_chunks(work, 2, SILENT, most_failures=49, executor=cluster.simulate)
    while not (waiting := Path(late).read_text()):
        time.sleep(0.01)
    (free,) = [worker for worker, process in cluster.client.run(os.getpid).items() if str(process) != waiting]
    cluster.client.submit(os.getpid, workers=[free], pure=False).result(LONG)  # it has stored what it was at
    left = digests(tmp_path / "run")
    Path(go).touch()
    for worker in cluster.client.scheduler_info()["workers"]:  # each has one thread, which is free only afterwards
        cluster.client.submit(os.getpid, workers=[worker], pure=False).result(LONG)
    assert digests(tmp_path / "run") == left
    assert not list((tmp_path / "run").rglob(".*.tmp"))


@pytest.mark.posix
@pytest.mark.parametrize(("name", "status"), [("SIGINT", 130), ("SIGKILL", -9)])
def test_nobody_is_left(name: str, status: int, tmp_path: Path) -> None:
    """Ctrl-C, which reaches all processes of a terminal; a kill of the parent alone. The worker has a child."""
    (tmp_path / "scratch").mkdir()
    code = VECTORISED.replace("def propagate", "chunk = 5\n\n    def propagate")
    path = write_campaign(tmp_path, "time.sleep(0.1)", code, samples=2_000)
    options = ("--out", tmp_path / "run", "--dask", 1, "--timeout", "100 s")
    there = environment() | {"TMPDIR": str(tmp_path / "scratch")}
    with running(command("run", path, *options), env=there) as process:
        wait_for(lambda: digests(tmp_path / "run"), process)
        (os.killpg if name == "SIGINT" else os.kill)(process.pid, signal.Signals[name])
        _, said = process.communicate(timeout=LONG)
        assert process.returncode == status, said
        assert left_of(process.pid) == []
    assert 0 < len(digests(tmp_path / "run")) < 400
    if name == "SIGINT":
        assert len(said.splitlines()) == 1, said
        assert said.startswith("error: interrupted; stored samples are kept")
    assert list((tmp_path / "scratch").iterdir()) == []


def _pipes() -> set[str]:
    found = set()
    for path in Path("/proc/self/fd").iterdir():
        with suppress(OSError):
            found.add(str(path.readlink()))
    return found


@pytest.mark.posix
def test_files_are_deleted_after_the_last_worker(cluster: Cluster) -> None:
    """Workers hold the pipe of the tracker that deletes their folder: one that outlives the run would make it again."""
    number = os.fstat(resource_tracker.getfd()).st_ino
    assert all(f"pipe:[{number}]" in held for held in cluster.client.run(_pipes).values())


KILLED = """
import os, signal
from mcnav.runner.dask_cluster import connect

def make(*arguments, make=os.mkdir, **named):
    make(*arguments, **named)
    os.kill(os.getpid(), signal.SIGKILL)

os.mkdir = make
with connect(None, 2):
    pass
"""


@pytest.mark.posix
def test_killed_as_soon_as_there_is_a_folder(tmp_path: Path) -> None:
    """The tracker that deletes a cluster's temporary files knows their folder before it exists."""
    (tmp_path / "scratch").mkdir()
    there = environment() | {"TMPDIR": str(tmp_path / "scratch")}
    with running([sys.executable, "-c", KILLED], env=there) as process:
        _, said = process.communicate(timeout=LONG)
        assert process.returncode == -signal.SIGKILL, said
        assert left_of(process.pid) == []
    assert list((tmp_path / "scratch").iterdir()) == []
