"""``mcnav`` and ``python -m mcnav``."""

from mcnav._interrupts import interruptible
from mcnav._streams import tolerate


def main() -> None:
    """Run the command line; its import takes long enough to be interrupted."""
    tolerate()
    with interruptible():
        from mcnav import cli

        cli.main()


if __name__ == "__main__":
    main()
