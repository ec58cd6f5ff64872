"""Fuzz campaign files: ``python -m tests.faults.fuzz 100000`` by mutation, or with ``--atheris`` guided by coverage.

The corpus is `campaigns/` and what `tests/faults/corpus` holds. Each file that comes out is read, or refused with
printable lines; anything else, or more than `LONGEST` seconds, is a finding, kept with the input that made it. Now and
then one that is read is also run. With ``--atheris`` (``pip install atheris``) libFuzzer chooses the mutations.
"""

from __future__ import annotations

import random
import sys
import tempfile
import time
import warnings
from collections import Counter
from importlib import import_module
from pathlib import Path

if "--atheris" in sys.argv:  # what reads files is watched; compiled code must be left as it is
    import atheris  # type: ignore[import-not-found]

    package = Path(__file__).parents[2] / "mcnav"
    compiled = [path for path in package.rglob("*.py") if "mcnav.compiled.jit import" in path.read_text("utf-8")]
    left_out = [*compiled, package / "physics" / "jit.py"]
    names = [".".join(path.relative_to(package.parent).with_suffix("").parts) for path in left_out]
    with atheris.instrument_imports(include=["mcnav", "tomllib", "pint"], exclude=names):
        import_module("mcnav.workflow.run")

from mcnav.config.read import read_campaign
from mcnav.errors import CampaignError, RunFolderError
from mcnav.workflow.run import run_campaign
from tests.conftest import ROOT

LONGEST = 10.0
RUN_EVERY = 500
"""Of the files that are read, one in so many is run."""

TOKENS = [
    b"nan",
    b"inf",
    b"-inf",
    b"1e308",
    b"-1",
    b"0",
    b"9" * 400,
    b"0x" + b"f",
    b"1e-400",
    b"true",
    b"1979-05-27",
    b'"5 km"',
    b'"nan km"',
    b'"1e999 m"',
    b'"5 km/km"',
    b'"5 furlong"',
    b'""',
    b'"\\u0000"',
    b'"\\U0001F680"',
    b"'''",
    b'"""',
    b"[",
    b"]",
    b"{",
    b"}",
    b"[[",
    b"]]",
    b"=",
    b".",
    b"\n",
    b"#",
    b"\x00",
    b"\xff",
    b"\r\n",
    b"[errors]\n",
    b"[scenario]\n",
    b"[[correlations]]\n",
    b"samples = 2\n",
    b'type = "reentry"\n',
    b'type = "../x.py:A"\n',
    b'type = "/etc/x.py:A"\n',
    b'design = "sobol"\n',
    b'"random"',
    b'"scipy.norm"',
    b'"scipy.levy_stable"',
    b'"table"',
    b'file = "/dev/zero.csv"',
    b"trajectory = 7\n",
    b"[" * 300,
    b"a." * 300,
    b'"' + b"x" * 5_000 + b'"',
    b"${HOME}",
    b"</script><script>alert(1)</script>",
    b"$\\\\frac{$",
]


def corpus() -> list[bytes]:
    """Files to begin with."""
    paths = [*sorted((ROOT / "campaigns").glob("*.toml")), *sorted((Path(__file__).parent / "corpus").glob("*"))]
    return [path.read_bytes() for path in paths]


def mutated(chance: random.Random, files: list[bytes]) -> bytes:
    """A file of the corpus with a few things done to it."""
    content = bytearray(chance.choice(files))
    lines = content.splitlines(keepends=True)
    for _ in range(chance.choice([1, 1, 2, 3, 6])):
        kind, place = chance.randrange(9), chance.randrange(len(content) + 1)
        if kind == 0 and content:
            content[place % len(content)] = chance.randrange(256)
        elif kind == 1:
            del content[place : place + chance.choice([1, 1, 2, 8, 40])]
        elif kind == 2:
            content[place:place] = chance.choice(TOKENS)
        elif kind == 3 and lines:
            content[place:place] = chance.choice(lines)
        elif kind == 4:
            other = chance.choice(files).splitlines(keepends=True)
            content += b"".join(chance.sample(other, min(len(other), 3)))
        elif kind == 5 and lines:
            chance.shuffle(lines)
            content = bytearray(b"".join(lines[: chance.randrange(1, len(lines) + 1)]))
        else:  # a value of some line becomes something else
            lines = content.splitlines(keepends=True)
            holding = [number for number, line in enumerate(lines) if b"=" in line and not line.startswith(b"#")]
            if holding:
                number = chance.choice(holding)
                lines[number] = lines[number].split(b"=")[0] + b"= " + chance.choice(TOKENS) + b"\n"
                content = bytearray(b"".join(lines))
    return bytes(content)


def outcome(content: bytes, place: Path, run: bool = False) -> str:
    """What becomes of a file: ``read``, ``run``, ``refused``; raises when anything else does."""
    path = place / "fuzzed.toml"
    path.write_bytes(content)
    began = time.monotonic()
    try:
        campaign = read_campaign(path, {"samples": 70} if run else None)
        if run:
            run_campaign(campaign, place / "run", None, 1, fresh=True)
        return "run" if run else "read"
    except (CampaignError, RunFolderError) as refused:
        lines = str(refused).splitlines()
        assert lines, "refused without a word"
        assert len(lines) <= 60, "too many lines"
        assert all(line.isprintable() and len(line) < 2_000 for line in lines), "a line that is none"
        return "refused"
    finally:
        took = time.monotonic() - began
        assert took < (60.0 if run else LONGEST), f"took {took:.1f} s"


def main(count: int, seed: int = 1) -> int:
    """Fuzz so many files by mutation; the number of findings."""
    chance, files, found = random.Random(seed), corpus(), Counter[str]()
    slowest = 0.0
    with tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as name:
        place = Path(name)
        for number in range(count):
            content = mutated(chance, files)
            began = time.monotonic()
            try:
                kind = outcome(content, place)
                slowest = max(slowest, time.monotonic() - began)
                if kind == "read" and found["read"] % RUN_EVERY == 0:
                    found[outcome(content, place, run=True) + " after being read"] += 1
            except BaseException as failure:
                if isinstance(failure, KeyboardInterrupt):
                    raise
                kind = "finding"
                kept = Path(tempfile.gettempdir()) / f"finding_{seed}_{number}.toml"
                kept.write_bytes(content)
                print(f"{kept}: {type(failure).__name__}: {str(failure)[:300]}", flush=True)
            found[kind] += 1
            if number % 10_000 == 9_999:
                print(f"{number + 1} files: {dict(found)}, slowest {slowest:.2f} s", flush=True)
    print(f"{count} files: {dict(found)}, slowest {slowest:.2f} s", flush=True)
    return found["finding"]


def guided() -> None:
    """Let libFuzzer drive; further arguments are its own."""
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        seeds = place / "corpus"
        seeds.mkdir()
        for number, content in enumerate(corpus()):
            (seeds / str(number)).write_bytes(content)
        arguments = [argument for argument in sys.argv if argument != "--atheris"]
        atheris.Setup([*arguments, str(seeds)], lambda content: outcome(content, place) and None)
        atheris.Fuzz()


if __name__ == "__main__":
    warnings.simplefilter("error")
    if "--atheris" in sys.argv:
        guided()
    else:
        sys.exit(main(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 1) > 0)
