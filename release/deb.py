"""Makes the Debian package: an environment of its own below /opt, with everything that mount-gateway needs from PyPI.

    python3 release/deb.py WHEEL VERSION FOLDER

Run it in a root of the Debian release that the package is for: the environment belongs to the Python of that release.
For another architecture than this machine's the compiled parts are taken from that one's wheels; nothing is run then.
"""

from __future__ import annotations

import gzip
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FILES = ROOT / "release" / "debian"
#: Where the package has its environment, and the extras that it brings along.
HOME, EXTRAS = Path("/opt/mount-gateway"), "library,metrics,mqtt"
#: Machine names of wheels, by Debian's name of the architecture.
MACHINES = {"amd64": "x86_64", "arm64": "aarch64"}
#: The newest C library that the wheels may need: Debian 12 has 2.36.
MANYLINUX = ("manylinux_2_34", "manylinux_2_28", "manylinux_2_17", "manylinux2014")
PYTHON = f"{sys.version_info[0]}.{sys.version_info[1]}"
PIP = [sys.executable, "-m", "pip", "--python", str(HOME / "bin" / "python"), "install", "--quiet", "--no-compile"]
#: Where each shell looks for completion.
SHELLS = {
    "bash": "usr/share/bash-completion/completions/mount-gateway",
    "zsh": "usr/share/zsh/vendor-completions/_mount-gateway",
}


def main() -> int:
    wheel, version, into = sys.argv[1:]
    completions = environment(Path(wheel).resolve())
    made(version, machine(), completions, Path(into))
    for architecture in sorted(set(MACHINES) - {machine()}):
        foreign(Path(wheel).resolve(), architecture)
        made(version, architecture, completions, Path(into))
    return 0


def environment(wheel: Path) -> dict[str, str]:
    """Make the environment in its place and install into it; return the completion of each shell."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(HOME)], check=True)
    subprocess.run([*PIP, f"{wheel}[{EXTRAS}]"], check=True)
    for program in (HOME / "bin").iterdir():  # the programs of the packages in it are nobody's business
        if not program.name.startswith(("python", "mount-gateway")):
            program.unlink()
    command = [str(HOME / "bin" / "python"), "-B", str(HOME / "bin" / "mount-gateway"), "completion"]
    return {
        shell: subprocess.run([*command, shell], check=True, capture_output=True, text=True).stdout for shell in SHELLS
    }


def foreign(wheel: Path, architecture: str) -> None:
    """Replace the packages in the environment by those for another architecture."""
    [site] = HOME.glob("lib/python*/site-packages")
    shutil.rmtree(site)
    words = ["--only-binary", ":all:", "--implementation", "cp", "--python-version", PYTHON, "--target", str(site)]
    words += [word for kind in MANYLINUX for word in ("--platform", f"{kind}_{MACHINES[architecture]}")]
    subprocess.run([*PIP, *words, f"{wheel}[{EXTRAS}]"], check=True)
    shutil.rmtree(site / "bin", ignore_errors=True)


def made(version: str, architecture: str, completions: dict[str, str], into: Path) -> None:
    """Make the package of the environment as it is."""
    for cache in list(HOME.rglob("__pycache__")):
        shutil.rmtree(cache)
    name = f"mount-gateway_{version}-1~{release()}_{architecture}.deb"
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        shutil.copytree(HOME, tree / HOME.relative_to("/"), symlinks=True)
        about(tree, version, architecture)
        for shell, text in completions.items():
            put(tree, SHELLS[shell], text)
        command = ["dpkg-deb", "--root-owner-group", "--build", "-Zzstd", str(tree), str(into / name)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    print(f"{name}: {(into / name).stat().st_size / 1e6:.0f} MB", flush=True)


def about(tree: Path, version: str, architecture: str) -> None:
    """Write everything of the package beside the environment."""
    size = sum(path.lstat().st_size for path in tree.rglob("*")) // 1024
    series = sys.version_info[1]
    put(tree, "DEBIAN/control", (FILES / "control").read_text().format(
        version=f"{version.replace('.dev', '~dev')}-1~{release()}", architecture=architecture, size=size,
        python=f"python3 (>= 3.{series}~), python3 (<< 3.{series + 1}~)",
    ))  # fmt: skip
    for script in ("postinst", "prerm", "postrm"):
        put(tree, f"DEBIAN/{script}", (FILES / script).read_text(), 0o755)
    put(tree, "usr/lib/systemd/system/mount-gateway@.service", unit())
    put(tree, "usr/lib/udev/rules.d/60-mount-gateway.rules", (FILES / "mount-gateway.rules").read_text())
    put(tree, "usr/share/doc/mount-gateway/copyright", (FILES / "copyright").read_text())
    put(tree, "usr/share/doc/mount-gateway/README.Debian", (FILES / "README.Debian").read_text())
    changes = gzip.compress((ROOT / "CHANGELOG.md").read_bytes(), mtime=0)
    (tree / "usr/share/doc/mount-gateway/changelog.gz").write_bytes(changes)
    program = tree / "usr/bin/mount-gateway"
    program.parent.mkdir(parents=True)
    program.symlink_to(HOME / "bin" / "mount-gateway")
    (tree / "etc/mount-gateway").mkdir(parents=True)


def unit() -> str:
    """Return the unit of mount-gateway@NAME, which runs /etc/mount-gateway/NAME.toml."""
    return (ROOT / "gateway" / "cli" / "serve" / "mount-gateway.service").read_text().format(
        program="/usr/bin/mount-gateway", config="/etc/mount-gateway/%i.toml", user="mount-gateway", group="dialout",
        folder="mount-gateway/%i",
    )  # fmt: skip


def put(tree: Path, name: str, text: str, mode: int = 0o644) -> None:
    path = tree / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    path.chmod(mode)


def release() -> str:
    """Return the Debian release of this root, as ``deb12``: each has its own Python."""
    text = Path("/etc/os-release").read_text()
    found = re.search(r'VERSION_ID="?(\d+)', text)
    return f"deb{found[1]}" if found else "sid"


def machine() -> str:
    return subprocess.run(["dpkg", "--print-architecture"], check=True, capture_output=True, text=True).stdout.strip()


if __name__ == "__main__":
    sys.exit(main())
