"""What pyproject.toml cannot say: every build begins from nothing.

setuptools copies the modules into build/lib and leaves them there, so that the next ``pip install .`` would install one
that has been removed from the source meanwhile.
"""

from __future__ import annotations

import shutil

from setuptools import setup
from setuptools.command.build_py import build_py


class Afresh(build_py):
    """Copies the modules into a folder that holds nothing else."""

    def run(self) -> None:
        if not self.editable_mode:
            shutil.rmtree(self.build_lib, ignore_errors=True)
        super().run()


setup(cmdclass={"build_py": Afresh})
