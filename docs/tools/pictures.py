"""Takes a picture of a program's window, small enough for a page."""

from __future__ import annotations

from pathlib import Path

from PIL import Image, ImageGrab

PICTURES = Path(__file__).resolve().parents[1] / "pictures"


def picture(name: str, part: tuple[int, int, int, int], display: str) -> None:
    """Write ``name``.png, of a part of a display: left, top, right, bottom in pixels."""
    path = PICTURES / f"{name}.png"
    image = ImageGrab.grab(xdisplay=display).crop(part).convert("RGB")
    image.quantize(colors=256, dither=Image.Dither.NONE).save(path, optimize=True)
    print(path.name, path.stat().st_size)
