"""A display that nobody sees, for programs with windows."""

from __future__ import annotations

from pathlib import Path

from .processes import Workshop, wait_until


def start_display(workshop: Workshop, home: Path, size: tuple[int, int]) -> dict[str, str]:
    """An X server of so many pixels across and down -> the environment of a Qt program on it, at home in a folder."""
    shown = home / "display"
    screen = f"{size[0]}x{size[1]}x24"
    # it chooses a free display itself, and writes its number
    workshop.start(["sh", "-c", f"exec Xvfb -displayfd 3 -screen 0 {screen} -noreset 3>{shown}"])
    wait_until("a display", lambda: shown.exists() and shown.read_text().strip().isdecimal())
    return {
        "DISPLAY": f":{shown.read_text().strip()}",
        "HOME": str(home),
        "LIBGL_ALWAYS_SOFTWARE": "1",
        "QT_QPA_PLATFORM": "xcb",
    }
