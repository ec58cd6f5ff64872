"""The program without what draws reports, for tests of anything else: ``python -m tests.undrawn run ...``."""

import sys
from types import ModuleType

from mcnav.cli import main


class _NoPage(ModuleType):
    """In place of `mcnav.report.page`: whatever it is asked to make is empty."""

    def __getattr__(self, name: str) -> object:
        if name.startswith("__"):
            raise AttributeError(name)
        return lambda *arguments: ""


if __name__ == "__main__":
    sys.modules["mcnav.report.page"] = _NoPage("mcnav.report.page")
    main()
