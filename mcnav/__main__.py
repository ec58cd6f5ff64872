"""``mcnav`` and ``python -m mcnav``."""

from mcnav._interrupts import interruptible


def main() -> None:
    """Run the command line; its import takes long enough to be interrupted."""
    with interruptible():
        from mcnav import cli

        cli.main()


if __name__ == "__main__":
    main()
