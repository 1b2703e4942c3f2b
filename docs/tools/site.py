"""Builds the site of the documentation from the pages of the project.

    python docs/tools/site.py FOLDER

It uses zensical in strict mode: a broken link is an error. It needs the extra ``docs``. The pages are laid out as in
the project, so that their links work; a source file to which a page links becomes a page. Files that the site would
download when it is read are taken from beside ``docs/site/zensical.toml``, or drawn.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SITE = ROOT / "docs" / "site"
PAGES = ("*.md", "docs/**/*.md", "mappings/README.md", "tests/*/README.md")
OTHERS = ("docs/pictures/*.png", "docs/pictures/*.svg", "docs/site/look.css", "docs/site/iframe-worker.js")
#: A link to a source file: its title, and the path after ``](``.
SOURCE = re.compile(r"\]\(([\w./-]+\.(?:py|toml))\)")
LANGUAGES = {".py": "python", ".toml": "toml"}
GRAPH = re.compile(r"(?ms)^```mermaid\ngraph TD\n(.*?)^```$")
#: What the theme makes every page download, and its replacement.
FETCHED, INSTEAD = "https://unpkg.com/iframe-worker/shim", "docs/site/iframe-worker.js"
WIDE, HIGH = 150, 64


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="where the site is written; what is there is replaced")
    into = parser.parse_args().folder
    with tempfile.TemporaryDirectory() as folder:
        built = build(Path(folder))
        if built is None:
            return 1
        shutil.rmtree(into, ignore_errors=True)
        shutil.copytree(built, into)
    print(f"open {into.resolve() / 'index.html'}")
    return 0


def build(folder: Path) -> Path | None:
    """Build the site in a folder of its own; return None if a page is wrong, after an error message."""
    lay_out(folder / "pages")
    shutil.copy(SITE / "zensical.toml", folder)
    zensical = Path(sys.executable).with_name("zensical")
    if not zensical.exists():
        print("zensical is missing: pip install '.[docs]'", file=sys.stderr)
        return None
    done = subprocess.run([zensical, "build", "--strict"], cwd=folder, capture_output=True, text=True)
    if done.returncode:
        print(done.stdout, done.stderr.partition("Traceback")[0], sep="", file=sys.stderr)
        return None
    site = folder / "site"
    for page in site.rglob("*.html"):
        text = page.read_text("utf-8")
        page.write_text(text.replace(FETCHED, os.path.relpath(site / INSTEAD, page.parent)), "utf-8")
    return site


def lay_out(pages: Path) -> None:
    """Copy every page and picture to the place it has in the project, and make a page for every linked source file."""
    for path in sorted({path for pattern in (*PAGES, *OTHERS) for path in ROOT.glob(pattern)}):
        there = pages / path.relative_to(ROOT)
        there.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix != ".md":
            shutil.copy(path, there)
            continue
        text = path.read_text("utf-8")
        for link in SOURCE.findall(text):
            show_source(path.parent / link, pages)
        text = SOURCE.sub(r"](\1.md)", text)
        there.write_text(GRAPH.sub(lambda found: drawing(found[1]), text), "utf-8")


def show_source(path: Path, pages: Path) -> None:
    """Return a source file as a page."""
    name = path.resolve().relative_to(ROOT)
    there = pages / f"{name}.md"
    there.parent.mkdir(parents=True, exist_ok=True)
    language, text = LANGUAGES[path.suffix], path.read_text("utf-8")
    there.write_text(f"# {name.name}\n\n`{name}`\n\n````{language}\n{text}````\n", "utf-8")


def drawing(graph: str) -> str:
    """Draw arrows ``a --> b``, all of them downward; the row of each node is its distance from the top."""
    arrows = [(above, below) for above, below in re.findall(r"(\w+) --> (\w+)", graph)]
    names = list(dict.fromkeys(name for arrow in arrows for name in arrow))
    row = dict.fromkeys(names, 0)
    for _ in names:
        for above, below in arrows:
            row[below] = max(row[below], row[above] + 1)
    rows = [[name for name in names if row[name] == number] for number in range(max(row.values()) + 1)]
    widest = max(map(len, rows))
    at = {
        name: ((place + (widest - len(ones) + 1) / 2) * WIDE, number * HIGH + HIGH / 2)
        for number, ones in enumerate(rows)
        for place, name in enumerate(ones)
    }
    lines = [
        f'<line x1="{at[above][0]:g}" y1="{at[above][1] + 15:g}" x2="{at[below][0]:g}" y2="{at[below][1] - 15:g}"/>'
        for above, below in arrows
    ]
    boxes = [
        f'<rect x="{x - 62:g}" y="{y - 15:g}" width="124" height="30" rx="6"/>'
        f'<text x="{x:g}" y="{y + 5:g}">{name}</text>'
        for name, (x, y) in at.items()
    ]
    size = f'viewBox="0 0 {widest * WIDE} {len(rows) * HIGH}" width="{widest * WIDE}"'
    return f'<svg class="layers" {size} role="img" aria-label="The layers">{"".join([*lines, *boxes])}</svg>\n'


if __name__ == "__main__":
    sys.exit(main())
