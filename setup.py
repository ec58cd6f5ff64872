"""Build step that pyproject.toml cannot state: the example campaigns of the checkout become data of the package."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from setuptools import setup
from setuptools.command.build_py import build_py

CAMPAIGNS: Final = Path("campaigns")
"""The one place of the examples; in a wheel they are in ``mcnav/campaigns``."""

ENDINGS: Final = (".toml", ".py", ".csv", ".parquet", ".md")


class BuildWithCampaigns(build_py):
    """Copies the example campaigns and the files that they read beside the modules."""

    def run(self) -> None:
        """Build the modules; an editable installation reads the examples from the checkout."""
        super().run()
        if not self.editable_mode:
            for source, target in self._campaigns().items():
                self.mkpath(str(target.parent))
                self.copy_file(str(source), str(target))

    def get_outputs(self, include_bytecode: bool = True) -> list[str]:
        """List the files that a build makes."""
        outputs: list[str] = super().get_outputs(include_bytecode)
        return outputs if self.editable_mode else [*outputs, *map(str, self._campaigns().values())]

    def _campaigns(self) -> dict[Path, Path]:
        target = Path(self.build_lib, "mcnav", "campaigns")
        files = sorted(path for path in CAMPAIGNS.rglob("*") if path.suffix in ENDINGS)
        return {path: target / path.relative_to(CAMPAIGNS) for path in files}


setup(cmdclass={"build_py": BuildWithCampaigns})
