"""``python -m mcnav``."""

from mcnav.cli import main

main()
