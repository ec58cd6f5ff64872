"""Compiled templates on disk, beside Python's own compiled files: compiling them takes half the time of a report."""

from __future__ import annotations

import hashlib
import sys
from contextlib import suppress
from importlib.util import cache_from_source
from pathlib import Path

import jinja2
from jinja2.bccache import Bucket, FileSystemBytecodeCache


class TemplateCache(FileSystemBytecodeCache):
    """Bytecode of templates, valid for one version of jinja2 and one content of the file that configures it.

    Like Python, it writes nothing with ``PYTHONDONTWRITEBYTECODE`` or where it may not, and does without.

    Parameters
    ----------
    configured_in : str
        The file.
    """

    def __init__(self, configured_in: str) -> None:
        digest = hashlib.sha256(Path(configured_in).read_bytes()).hexdigest()[:16]
        folder = Path(cache_from_source(configured_in)).parent
        super().__init__(str(folder), f"jinja2-{jinja2.__version__}-{digest}-%s.cache")

    def load_bytecode(self, bucket: Bucket) -> None:
        """Load a template, if that is possible."""
        with suppress(OSError):
            super().load_bytecode(bucket)

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Store a template, if that is possible."""
        if not sys.dont_write_bytecode:
            with suppress(OSError):
                super().dump_bytecode(bucket)
