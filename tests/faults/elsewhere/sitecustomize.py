"""Hides signals, calls and modules of POSIX from the package; the libraries that it uses see the real ones."""

import builtins
import multiprocessing
import os
import signal
import sys
import types

SIGNALS = ("SIGINT", "SIGTERM", "SIGABRT", "SIGFPE", "SIGILL", "SIGSEGV", "SIG_DFL", "SIG_IGN")
CALLS = (
    "fork", "forkpty", "register_at_fork", "killpg", "setsid", "getpgid", "getuid", "geteuid", "fchmod", "nice",
    "getloadavg", "sched_getaffinity", "uname", "sysconf", "statvfs", "mkfifo", "chown", "wait", "waitid", "WNOHANG",
    "O_DIRECTORY", "O_NOFOLLOW",
)  # fmt: skip
LACKING = {
    "os": frozenset(CALLS),
    "signal": frozenset(
        {name for name in dir(signal) if name.startswith(("SIG", "ITIMER", "pthread")) and name not in SIGNALS}
        | {"setitimer", "getitimer", "alarm", "pause", "sigwait", "siginterrupt", "sigpending"}
    ),
}
MODULES = ("resource", "fcntl", "pwd", "grp", "termios")


class Poorer(types.ModuleType):
    """A module without some of its names."""

    def __init__(self, module: types.ModuleType, lacking: frozenset[str]) -> None:
        super().__init__(module.__name__)
        self.__dict__.update({name: value for name, value in vars(module).items() if name not in lacking})


class WithoutFlags(types.ModuleType):
    """The module ``sys`` without ``abiflags``; what is set here is set there."""

    def __getattr__(self, name: str) -> object:
        if name == "abiflags":
            raise AttributeError(name)
        return getattr(sys, name)

    def __setattr__(self, name: str, value: object) -> None:
        setattr(sys, name, value)

    def __delattr__(self, name: str) -> None:
        delattr(sys, name)


POORER = {"os": Poorer(os, LACKING["os"]), "signal": Poorer(signal, LACKING["signal"])}
POORER["os"].name = "nt"
POORER["sys"] = WithoutFlags("sys")
load = builtins.__import__


def load_as_elsewhere(name, globals=None, locals=None, fromlist=(), level=0):
    importer = (globals or {}).get("__name__", "")
    if importer.partition(".")[0] == "mcnav":
        if name in MODULES:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        if name in POORER:
            return POORER[name]
    return load(name, globals, locals, fromlist, level)


builtins.__import__ = load_as_elsewhere
multiprocessing.set_start_method("spawn")
