"""What pyproject.toml cannot say: which packages there are, that a build begins from nothing, and its commit.

The packages are every folder of ``gateway/``, and the command tables, which lie beside it and are installed inside it.

setuptools copies the modules into build/lib and leaves them there, so that the next ``pip install .`` would install one
that has been removed from the source meanwhile.

A package that is built from a git checkout, as by ``pip install .``, is told the commit, which it cannot find later. A
release has it in the source already; a source distribution without it is built all the same.
"""

from __future__ import annotations

import runpy
import shutil
from pathlib import Path

from setuptools import find_packages, setup
from setuptools.command.build_py import build_py


class Afresh(build_py):
    """Copies the modules into a folder that holds nothing else."""

    def run(self) -> None:
        if not self.editable_mode:
            shutil.rmtree(self.build_lib, ignore_errors=True)
        super().run()
        told = Path(self.build_lib, "gateway", "commit.txt")
        if not self.editable_mode and not told.exists() and (commit := checked_out()):
            told.write_text(commit + "\n", "utf-8")


def checked_out() -> str:
    """Return the commit of this checkout, which the program itself can read without git; empty if this is none."""
    source = Path(__file__).resolve().parent
    about = runpy.run_path(str(source / "gateway" / "core" / "about.py"))
    return str(about["head_commit"](source / ".git")).strip()


setup(packages=[*find_packages(include=["gateway", "gateway.*"]), "gateway.mappings"], cmdclass={"build_py": Afresh})
