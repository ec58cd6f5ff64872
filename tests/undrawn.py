"""The program without report pages, for tests of other parts: ``python -m tests.undrawn run ...``."""

import sys
from types import ModuleType

from mcnav.cli import main


class _NoPage(ModuleType):
    """Substitute for `mcnav.report.page`, whose functions return empty text."""

    def __getattr__(self, name: str) -> object:
        if name.startswith("__"):
            raise AttributeError(name)
        return lambda *arguments: ""


if __name__ == "__main__":
    sys.modules["mcnav.report.page"] = _NoPage("mcnav.report.page")
    main()
