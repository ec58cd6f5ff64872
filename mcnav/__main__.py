"""``mcnav`` and ``python -m mcnav``."""

import sys

from mcnav import _supervision
from mcnav._streams import tolerate


def main() -> None:
    """Run the command line, under a supervisor if it may execute a user's code.

    Its import takes long enough to be interrupted.
    """
    tolerate()
    if _supervision.names_code(sys.argv[1:]) and (status := _supervision.supervise()) is not None:
        sys.exit(status)
    from mcnav._interrupts import interruptible  # which a supervisor does without

    with _supervision.supervised(), interruptible():
        from mcnav import cli

        cli.main()


if __name__ == "__main__":
    main()
