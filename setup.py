"""What pyproject.toml cannot say: which packages there are, and that every build begins from nothing.

The packages are every folder of ``gateway/``, and the command tables, which lie beside it and are installed inside it.

setuptools copies the modules into build/lib and leaves them there, so that the next ``pip install .`` would install one
that has been removed from the source meanwhile.
"""

from __future__ import annotations

import shutil

from setuptools import find_packages, setup
from setuptools.command.build_py import build_py


class Afresh(build_py):
    """Copies the modules into a folder that holds nothing else."""

    def run(self) -> None:
        if not self.editable_mode:
            shutil.rmtree(self.build_lib, ignore_errors=True)
        super().run()


setup(packages=[*find_packages(include=["gateway", "gateway.*"]), "gateway.mappings"], cmdclass={"build_py": Afresh})
