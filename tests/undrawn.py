"""The program without what draws reports, for tests of anything else: ``python -m tests.undrawn run ...``."""

import sys
from types import SimpleNamespace
from typing import Any, cast

from mcnav.cli import main

if __name__ == "__main__":
    sys.modules["mcnav.report.page"] = cast(Any, SimpleNamespace(render=lambda content: ""))
    main()
