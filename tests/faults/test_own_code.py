"""Whatever a user's code does to its process, a command ends with a line of its own or with its results.

The code acts while it is read, while its class is made, while it gives its sources, and in its simulations. A command
without a supervisor ended without a word, with status 0 or that of the code.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import time
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import mcnav
from mcnav.config.read import read_campaign
from mcnav.contract.scenario import ScenarioError
from mcnav.frames import simulation
from mcnav.runner import worker_processes
from mcnav.systems import timeouts
from mcnav.systems.user.stochastic_scenario import is_users_with_noise
from tests.commands import invoke
from tests.faults.scenarios import SINGLE, VECTORISED, command, environment, write_campaign
from tests.forked import run_forked
from tests.processes import run_to_end, running, wait_for

IMPORTS = "import ctypes, os, signal, sys, threading\n"

PLACES = {
    "read": ("class Mine:", "ACT\n\nclass Mine:", "while it was read"),
    "made": ("chunk = 25", "chunk = 25\n\n    def __init__(self):\n        ACT", "while Mine was made"),
    "sources": (
        'sources = (Source("a", "m", "m", 1.0),)',
        '@property\n    def sources(self):\n        ACT\n        return (Source("a", "m", "m", 1.0),)',
        "while it gave Mine.sources",
    ),
    "simulated": ("return np", "ACT\n        return np", r"while it was (linearized|tried out)"),
}
"""Where the code acts: what is replaced in the class, and how the line names it."""

ENDS = {
    "os._exit(0)": "the program ended with exit status 0 in mine.py {}",
    "os._exit(7)": "the program ended with exit status 7 in mine.py {}",
    "ctypes.CDLL(None).exit(0)": "the program ended with exit status 0 in mine.py {}",
    "ctypes.string_at(0)": r"the program crashed \(SIGSEGV\) in mine.py {}",
    "os.kill(os.getpid(), signal.SIGKILL)": "the program was ended by SIGKILL in mine.py {}",
    "os.closerange(0, 4096)": "mine.py closed or redirected files that the program has open {}",
    "os.dup2(os.open(os.devnull, os.O_WRONLY), 1)": "mine.py closed or redirected files that the program has open {}",
    "os.chdir('/')": r"mine.py changed the current folder \(to /; name files by settings of type Path\) {}",
    "os.fork() and None": "mine.py made a copy of the program by fork that came back .* {}",
    "raise KeyboardInterrupt": r"KeyboardInterrupt: \(line",
    "raise GeneratorExit": r"GeneratorExit: \(line",
    "sys.exit(0)": r"SystemExit: 0 \(line",
    "raise ValueError('no fuel')": r"ValueError: no fuel \(line",
}
"""What the code does, and the line that follows."""

HARMLESS = (
    "sys.setrecursionlimit(70)", "np.seterr(all='raise')", "os.umask(0o777)", "sys.stdout = sys.stderr = None",
    "signal.signal(signal.SIGINT, signal.SIG_IGN)", "os.environ['HOME'] = '/nowhere'", "print('x' * 3_000_000)",
    "threading.Thread(target=threading.Event().wait).start()", "import atexit; atexit.register(os._exit, 0)",
)  # fmt: skip
"""What a command undoes, or does not mind."""


def _write(folder: Path, place: str, act: str) -> None:
    before, after, _ = PLACES[place]
    code = VECTORISED.replace('("c", "m", "m"))', '("c", "m", "m"))\n    chunk = 25')
    write_campaign(folder, "", IMPORTS + code.replace(before, after.replace("ACT", act), 1), samples=60)


def _run(*arguments: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    return run_forked(*arguments, cwd=cwd, env={"MCNAV_CACHE_DIR": str(cwd / "cache")})


def _run_process(*arguments: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    return run_to_end(command(*arguments), cwd=cwd, env=environment() | {"MCNAV_CACHE_DIR": str(cwd / "cache")})


def _line(done: subprocess.CompletedProcess[str]) -> str:
    """The one line of a command that has failed, with its status."""
    assert done.returncode == 2, (done.returncode, done.stdout, done.stderr)
    *notes, line = done.stderr.splitlines()
    assert all(note.startswith("note: ") for note in notes), done.stderr
    assert line.startswith("error: ")
    assert "next:" not in done.stdout
    return line


ASKED = ("os._exit(0)", "os.chdir('/')", "raise KeyboardInterrupt")
"""What the code does where it is asked for something: one function of ours asks in all these places."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("place", "act"),
    [*product(("read", "simulated"), ENDS), *product(("made", "sources"), ASKED)],
)
def test_code_that_ends_or_spoils_its_process(place: str, act: str, tmp_path: Path) -> None:
    _write(tmp_path, place, act)
    pattern = ENDS[act].format(PLACES[place][2])
    if place == "simulated" and act == "os.fork() and None":  # a fork of each simulation is noticed at the first
        pattern = "by fork"
    # a copy of a process that multiprocessing has made may make others
    run = _run_process if "fork" in act else _run
    assert re.search(pattern, _line(run("run", "mine.toml", "--jobs", "2", cwd=tmp_path)))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["check", "lincov", "linearity"])
@pytest.mark.parametrize("act", ["os._exit(0)", "ctypes.string_at(0)"])
def test_every_command_says_how_it_ended(name: str, act: str, tmp_path: Path) -> None:
    _write(tmp_path, "simulated", act)
    assert "in mine.py while it was" in _line(_run(name, "mine.toml", cwd=tmp_path))
    if name == "check":
        _write(tmp_path, "read", act)
        assert "in mine.py while it was read" in _line(_run(name, "mine.py", cwd=tmp_path))


@pytest.mark.slow
@pytest.mark.parametrize("place", ["read", "simulated"])
def test_what_is_undone_changes_nothing(place: str, tmp_path: Path) -> None:
    """All of it at once; the sums are those of a class that does nothing, and files can be read."""
    _write(tmp_path, place, "pass")
    calm = _run("run", "mine.toml", "--jobs", "1", "--format", "csv", "--out", "calm", cwd=tmp_path)
    acts = HARMLESS if place == "read" else [act for act in HARMLESS if "Thread" not in act and "print" not in act]
    _write(tmp_path, place, "; ".join(acts))
    done = _run("run", "mine.toml", "--jobs", "1", "--format", "csv", "--out", "run", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    columns = [text.replace("x" * 3_000_000 + "\n", "").replace("calm", "mine") for text in (calm.stdout, done.stdout)]
    assert columns[0] == columns[1]
    assert all(path.stat().st_mode & 0o600 == 0o600 for path in (tmp_path / "run").rglob("*") if path.is_file())


def test_a_sample_of_the_campaign_is_named(tmp_path: Path) -> None:
    """What is stored before is kept; with a limit on time the same sample fails alone, in a process of its own."""
    path = write_campaign(tmp_path, "", VECTORISED.replace("def prop", "chunk = 25\n\n    def prop"), samples=200)
    drawn = read_campaign(path).errors.draw("random", 1, 200, 0, 200)[:, 0]
    value = float(drawn[160])
    act = f"if (np.abs(a - {value!r}) < 1e-12).any():\n    import os\n    os._exit(0)"
    write_campaign(tmp_path, act, VECTORISED.replace("def prop", "chunk = 25\n\n    def prop"), samples=200)
    line = _line(_run("run", path, "--jobs", "1", "--out", "run", cwd=tmp_path))
    assert "in mine.py while it simulated samples 150 to 174; stored samples are kept; with sample_timeout" in line
    kept = sorted(each.name for each in (tmp_path / "run" / "samples").glob("part-*.parquet"))
    assert kept == [f"part-0000{number}.parquet" for number in range(6)]
    # in this process, whose workers start in no time
    done = invoke("run", path, "--jobs", 1, "--out", "run", "--timeout", "1 min", "--no-report", cwd=tmp_path)
    assert done.returncode == 3, done.stderr
    samples = mcnav.samples_of(tmp_path / "run")
    assert np.flatnonzero(samples["status"] != "ok").tolist() == [160]


def test_flights_for_the_linear_model_have_the_time_limit(tmp_path: Path) -> None:
    """A flight that never ends, and one that no signal stops: each is told with the file."""
    path = write_campaign(tmp_path, "time.sleep(600)", SINGLE, samples=20)
    line = _line(_run("run", path, "--timeout", "0.2 s", "--out", "run", cwd=tmp_path))
    assert line.endswith("its flight without any error failed: took longer than 0.2 s")
    write_campaign(tmp_path, "sum(range(10**12))", SINGLE, samples=20)
    line = _line(_run("run", path, "--timeout", "0.2 s", "--out", "other", cwd=tmp_path))
    assert "the program exceeded the time limit of a sample in mine.py while it was linearized" in line


def test_a_second_interrupt_ends_code_that_listens_to_none(tmp_path: Path) -> None:
    """Both go to the command alone, as by ``kill``; the code is in a compiled function."""
    path, mark = write_campaign(tmp_path, "", SINGLE, samples=20), tmp_path / "under way"
    write_campaign(tmp_path, f"open({str(mark)!r}, 'w').close(); sum(range(10**12))", SINGLE, samples=20)
    with running(command("run", path, "--out", tmp_path / "run"), env=environment()) as process:
        wait_for(mark.exists, process)
        process.send_signal(signal.SIGINT)
        time.sleep(0.5)  # signals that come at once are one
        assert process.poll() is None
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert said == "error: interrupted; stored samples are kept\n"


def _write_member(folder: Path, name: str, act: str) -> Path:
    """Write a campaign whose class has a property that acts in place of a member."""
    kind = SINGLE if name == "noise_covariance" else VECTORISED
    takes = ("self, errors", "self, errors, noise") if name == "noise_covariance" else ("", "")
    member = f"    @property\n    def {name}(self):\n        {act}\n\n    def "
    flown = kind.replace("chunk = 25", "").replace("class Mine:", f"{IMPORTS}class Mine:")
    if name == "fly":
        flown = flown.replace("def propagate(", "def other(")
    return write_campaign(folder, "", flown.replace("    def ", member, 1).replace(*takes), samples=60)


@pytest.mark.parametrize("name", ["epochs", "fly", "partials", "history", "noise_covariance", "chunk"])
def test_members_that_are_asked_for(name: str, tmp_path: Path) -> None:
    """A property that raises, also what would end the command, is one line; it is no traceback."""
    for act, words in (("sys.exit(0)", r"SystemExit: 0 \(line"), ("raise ValueError('no')", "no")):
        path = _write_member(tmp_path, name, act)
        with pytest.raises((mcnav.CampaignError, ScenarioError), match=rf"Mine\.{name}: .*{words}"):
            _ask_for_all(path)


@pytest.mark.slow
def test_a_member_that_ends_the_program_is_named(tmp_path: Path) -> None:
    for name in ("partials", "epochs"):
        _write_member(tmp_path, name, "os._exit(0)")
        assert f"exit status 0 in mine.py while it gave Mine.{name}" in _line(_run("lincov", "mine.toml", cwd=tmp_path))


@pytest.mark.posix
@pytest.mark.parametrize(
    ("member", "words"),
    [
        ("", "mine.py cannot be executed"),
        ("__init__", "Mine cannot be made"),
        ("partials", "partials"),
        ("history", "history"),
    ],
)
def test_what_is_asked_besides_samples_has_a_time_limit(
    member: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is longer than that of a sample: packages take their time to be imported."""
    monkeypatch.setattr(timeouts, "READING", 0.3)
    defined = (
        f"    def {member}(self):\n        time.sleep(600)\n\n    def propagate" if member else "    def propagate"
    )
    code = VECTORISED.replace("    def propagate", defined, 1)
    code = code if member else code.replace("class Mine:", "time.sleep(600)\n\nclass Mine:")
    path = write_campaign(tmp_path, "", code, samples=60, more='sample_timeout = "0.1 s"')
    with pytest.raises((mcnav.CampaignError, ScenarioError), match=rf"{words}: took longer than 0\.3 s \(line"):
        _ask_for_all(path)


def _ask_for_all(path: Path) -> None:
    """Read a campaign, and ask its scenario for all that comes before samples."""
    campaign = read_campaign(path)
    campaign.scenario.engine(campaign.scenario.engines[0], np.zeros((1, 1)))
    campaign.scenario.nominal()
    if is_users_with_noise(campaign.scenario):
        assert campaign.scenario.noise


def test_from_python_it_is_refused(tmp_path: Path) -> None:
    """In the user's own process there is no supervisor: what can be undone is, and the class is refused."""
    _write(tmp_path, "read", "os.chdir('/')")
    before = Path.cwd()
    with pytest.raises(mcnav.CampaignError, match=r"mine\.py changed the current folder"):
        read_campaign(tmp_path / "mine.toml")
    assert Path.cwd() == before


@pytest.mark.posix
def test_flights_have_the_time_limit_in_every_command(tmp_path: Path) -> None:
    """The limit is the object's own; only `run` knew it, and `lincov` and `sweep` simulated for ever."""
    path = write_campaign(tmp_path, "time.sleep(600)", SINGLE, samples=20, more='sample_timeout = "0.1 s"')
    with pytest.raises(ScenarioError, match=r"flight without any error failed: took longer than 0\.1 s"):
        read_campaign(path).scenario.linear()


@pytest.mark.slow
def test_a_command_does_not_wait_for_idle_workers(tmp_path: Path) -> None:
    """A class with a time limit is tried out in a process of its own, which is idle for a minute before it ends."""
    write_campaign(tmp_path, "", SINGLE, samples=60, more='sample_timeout = "1 min"')
    begun = time.monotonic()
    assert _run("lincov", "mine.toml", cwd=tmp_path).returncode == 0
    assert time.monotonic() - begun < worker_processes.IDLE


FUNCTION_DOES = {
    "chdir": (lambda: os.chdir("/"), ValueError, r"the function changed the current folder \(to /"),
    "exit": (lambda: os._exit(0), RuntimeError, "ended its process within samples 8,192 to 24,999"),
}
"""What a function does in a worker, and the exception that follows."""


@pytest.mark.parametrize("act", FUNCTION_DOES)
def test_a_function_that_misbehaves_in_a_worker(act: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(simulation.COST, "loky", 0.0)
    do, kind, words = FUNCTION_DOES[act]
    own, before = os.getpid(), Path.cwd()

    def function(errors: np.ndarray) -> np.ndarray:
        if os.getpid() != own:
            do()
        return 2.0 * errors

    with pytest.raises(kind, match=words):
        mcnav.simulate(function, mcnav.Errors({"a": 1.0}).draw(25_000, seed=1), jobs=2)
    assert Path.cwd() == before


def test_a_function_that_changes_the_folder_has_no_partials() -> None:
    before = Path.cwd()

    def function(errors: np.ndarray) -> np.ndarray:
        os.chdir("/")
        return errors

    with pytest.raises(ValueError, match="the function changed the current folder"):
        mcnav.partials(function, mcnav.Errors({"a": 1.0}))
    assert Path.cwd() == before
