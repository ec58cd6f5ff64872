"""One mutant at a time: write it, run the tests that reach it, say what became of it."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from tests.mutation.child import run_tests
from tests.mutation.mutants import Mutant, choose
from tests.mutation.references import Node, read_references
from tests.mutation.sites import mutate
from tests.mutation.tree import copy_tree, drop_compiled, environment

TESTS: Final = ("tests/unit", "mcnav", "tests/properties", "tests/cross", "tests/statistical", "tests/published")
"""Folders of the tests that are recorded and run."""

FURTHER: Final = ("tests/campaigns",)
"""Folders whose tests are recorded and run after those."""

BATCH: Final = 12.0
"""Seconds of tests that are tried together first; the rest is run in one go."""

COMPILING: Final = 0.06
"""Seconds, for each line of a function that must be compiled anew."""

LIMIT: Final = (60.0, 4.0)
"""Seconds of processor time, and times the recorded one, after which a mutant counts as endless."""


@dataclass(frozen=True)
class Fate:
    """What became of a mutant: the test that failed, or none; tests that ran; seconds of processor time."""

    killer: str
    tests: int
    seconds: float


class Trial:
    """Tests of a copy of the tree in a working folder, which is made unless it is there."""

    def __init__(self, work: Path) -> None:
        self.tree, self.warm, self.cache = work / "tree", work / "warm", work / "cache"
        self.record, self.scratch = work / "record.jsonl", work / "scratch"
        if not self.record.exists():
            shutil.rmtree(work, ignore_errors=True)
            copy_tree(self.tree)
            self._record()
        recorded = (json.loads(line) for line in self.record.read_text().splitlines())
        self.tests: dict[str, tuple[float, list[str]]] = {
            name: (seconds, functions) for name, seconds, functions in recorded
        }
        self.references = read_references(self.tree)
        self._sound = set[str]()

    def _record(self) -> None:
        command = [sys.executable, "-m", "pytest", "-p", "tests.mutation.recording", *TESTS, *FURTHER]
        own = environment(self.tree, self.warm) | {"MCNAV_RECORD": str(self.record)}
        subprocess.run([*command, f"--basetemp={self.scratch}"], cwd=self.tree, env=own)

    def try_mutant(self, mutant: Mutant) -> Fate:
        """Run the tests that reach a mutant, until one fails."""
        node = (mutant.path, mutant.site.owner)
        anew = self.references.compiled_after(node) if not self._is_plain(mutant) else set()
        drop_compiled(self.warm, self.cache, anew)
        path = self.tree / mutant.path
        source, stamps = path.read_text(), path.stat()
        path.write_text(mutate(source, mutant.site, mutant.choice))
        os.utime(path, (stamps.st_atime, stamps.st_mtime + 2.0 + mutant.site.begin))  # other bytecode
        ran, seconds = 0, 0.0
        try:
            for batch in self._batches(mutant, anew):
                killer, took = self._run(batch)
                ran, seconds = ran + len(batch), seconds + took
                if killer:
                    return Fate(killer, ran, seconds)
            return Fate("", ran, seconds)
        finally:
            path.write_text(source)
            os.utime(path, (stamps.st_atime, stamps.st_mtime))

    def fails_unchanged(self, test: str) -> bool:
        """Return whether a test that failed with a mutant fails without it, too; then it is no test of this trial."""
        if test in self.tests and test not in self._sound:
            drop_compiled(self.warm, self.cache, set())
            if self._run([test])[0]:
                del self.tests[test]
                return True
            self._sound.add(test)
        return False

    def _is_plain(self, mutant: Mutant) -> bool:
        """Return whether only the interpreter sees a place: in a method, or a function that nothing compiled uses."""
        return "." in mutant.site.function

    def reaching(self, mutant: Mutant) -> dict[str, bool]:
        """Return the tests that reach a mutant, and whether they import its module."""
        names = self._called(mutant)
        importers = self.references.importers[mutant.path]
        found = {}
        for test, (_, functions) in self.tests.items():
            file = test.split("::")[0]
            direct = file in importers or file == mutant.path
            if direct or names.intersection(functions):
                found[test] = direct
        return found

    def _called(self, mutant: Mutant) -> set[str]:
        """Return the recorded functions by way of which a mutant is reached; the nearest.

        Compiled code calls other compiled code without its being recorded, so that its callers count as well.
        """
        known = {name for _, functions in self.tests.values() for name in functions}
        compiled = self.references.lines
        own, first = f"{mutant.path}:{mutant.site.function}", (mutant.path, mutant.site.owner)
        if mutant.site.function and own in known and first not in compiled:
            return {own}
        by_owner: dict[Node, set[str]] = {}
        for name in known:
            path, function = name.split(":")
            by_owner.setdefault((path, function.split(".")[0]), set()).add(name)
        left: list[Node] = [first]
        seen, found = set(left), set()
        while left:
            node = left.pop()
            found |= by_owner.get(node, set())
            if node in by_owner and node not in compiled:
                continue
            further = self.references.users.get(node, set()) - seen
            seen |= further
            left.extend(further)
        return found

    def _batches(self, mutant: Mutant, anew: set[Node]) -> list[list[str]]:
        """Return the tests to run: the cheapest, the others, those of whole campaigns, then the rest of the files."""
        reaching = self.reaching(mutant)
        costs = {test: self._cost(test, anew) * (1.0 if direct else 2.0) for test, direct in reaching.items()}
        ranked = sorted(reaching, key=lambda test: (costs[test], test))
        near = [test for test in ranked if not test.startswith(FURTHER)]
        first: list[str] = []
        total = 0.0
        for test in near:
            total += self.tests[test][0]
            if first and total > BATCH:
                break
            first.append(test)
        files = {test.split("::")[0] for test in near}
        rest = [test for test in self.tests if test.split("::")[0] in files and test not in reaching]
        batches = [first, near[len(first) :], [test for test in ranked if test.startswith(FURTHER)] + rest]
        return [batch for batch in batches if batch]

    def _cost(self, test: str, anew: set[Node]) -> float:
        seconds, functions = self.tests[test]
        needed: set[Node] = set()
        for name in functions if anew else ():
            path, function = name.split(":")
            needed |= self._compiled_by((path, function.split(".")[0]))
        return seconds + COMPILING * sum(self.references.lines[node] for node in needed & anew)

    def _compiled_by(self, node: Node) -> set[Node]:
        if node not in self._known:
            self._known[node] = self.references.compiled_by(node)
        return self._known[node]

    _known: dict[Node, set[Node]] = {}  # noqa: RUF012

    def _run(self, tests: list[str]) -> tuple[str, float]:
        """Run tests until one fails; return its name, or what else happened, and seconds of processor time."""
        limit = int(LIMIT[0] + LIMIT[1] * sum(self.tests[test][0] for test in tests))
        child = os.fork()
        if not child:
            run_tests(tests, self.tree, self.cache, self.scratch, limit)
        _, status, used = os.wait4(child, 0)
        seconds = used.ru_utime + used.ru_stime
        if status == 0:
            return "", seconds
        if os.WIFSIGNALED(status):
            endless = os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGKILL)
            return "endless" if endless else f"signal {os.WTERMSIG(status)}", seconds
        output = self.scratch.with_suffix(".txt").read_text()
        named = re.search(r"^(?:FAILED|ERROR) (.*?)(?: - .*)?$", output, re.MULTILINE)
        return named.group(1) if named else f"exit code {os.waitstatus_to_exitcode(status)}", seconds


def main(count: int, seed: int, only: str, work: Path) -> None:
    """Try so many mutants, and print the fate of each and the number killed."""
    trial = Trial(work)
    killed = 0
    for number, mutant in enumerate(choose(trial.tree, count, seed, only), 1):
        began = time.monotonic()
        while trial.fails_unchanged((fate := trial.try_mutant(mutant)).killer):
            print(f"fails without a mutant: {fate.killer}", flush=True)
        killed += bool(fate.killer)
        print(
            f"{number}\t{mutant}\t{fate.killer or 'SURVIVED'}\t{fate.tests} tests\t{fate.seconds:.0f} s\t"
            f"{time.monotonic() - began:.0f} s",
            flush=True,
        )
    print(f"{killed} of {count} killed")
