"""``mcnav`` and ``python -m mcnav``."""

import sys

from mcnav.execution import supervision
from mcnav.execution.streams import tolerate


def main() -> None:
    """Run the command line, under a supervisor if it may execute a user's code.

    Its import takes long enough to be interrupted.
    """
    tolerate()
    if supervision.names_code(sys.argv[1:]) and (status := supervision.supervise()) is not None:
        sys.exit(status)
    from mcnav.execution.interrupts import interruptible  # which a supervisor does without

    with supervision.supervised(), interruptible():
        from mcnav import cli

        cli.main()


if __name__ == "__main__":
    main()
