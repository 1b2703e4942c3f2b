"""Repeats attacks that once were successful, and judges them by the simulated mount's true axes. Standalone.

    python -m tests.soak.attacks [--tree PATH] [--json out.json] [--at-once 6] [--only WORDS]
    python -m tests.soak.attacks --compare before.json after.json

``--alpaca`` tries the attacks on NexStars on the Alpaca telescopes of their kinds instead.

Real processes on loopback in real time: the mount is of this checkout, the gateway of ``--tree``. Exit code 1 if a
limit was passed or a stop did not hold. ``--compare`` prints a Markdown table of two such runs.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from tests.soak.attack_limits import LIMITS, Attack
from tests.soak.attack_motion import MOTION
from tests.soak.attack_settings import SETTINGS
from tests.soak.attack_syncs import SYNCS_AND_WAYS
from tests.soak.attacked import HERE, Attacked

ATTACKS = [*LIMITS, *MOTION, *SETTINGS, *SYNCS_AND_WAYS]
UNITS = {"altitude": "°", "sun": "°", "turned": "°", "past meridian": "°", "off": "°",
         "told": "°", "after the stop": " s",
         "drift": "″/min", "untold": "", "wrong": ""}  # fmt: skip
SHOWN = {"altitude": "worst altitude", "sun": "nearest to the Sun", "turned": "turned",
         "past meridian": "past the meridian", "off": "off the goal",
         "told": "told a site that is wrong by", "after the stop": "in motion after the stop",
         "drift": "drift changed by", "untold": "goto ended short, not told", "wrong": "wrong answers"}  # fmt: skip
Row = dict[str, Any]


def of_its_kind(attack: Attack, mount: str) -> str | None:
    """Return the Alpaca telescope of the kind of a NexStar; None where the attack is on what only a NexStar has."""
    if not mount.startswith("nexstar") or "--unaligned" in attack.sim:  # ASCOM has no word for the alignment
        return None
    german = mount.removeprefix("nexstar:").startswith(("cg", "avx"))
    return "alpaca:german" if german else "alpaca:polar" if "wedge" in attack.name else "alpaca:altaz"


def once(attack: Attack, mount: str, tree: Path) -> Row:
    """Run one attack on one mount; return its figures, and whether the gateway withstood it."""
    figure, least, most = attack.judged
    row: Row = {"group": attack.group, "attack": attack.name, "mount": mount, "judged": figure, "least": least,
                "most": most}  # fmt: skip
    options = tuple(option for option in attack.options if option != "--hibernate" or knows(tree, option))
    with tempfile.TemporaryDirectory() as place:
        try:
            with Attacked(
                tree,
                Path(place),
                mount,
                *options,
                surface=attack.surface,
                start=attack.start,
                host=attack.host,
                sim=attack.sim,
                site=attack.site,
            ) as at:
                time.sleep(attack.settled)
                extra = attack.script(at) or {}
                row["figures"] = {**at.figures(), **{name: round(value, 2) for name, value in extra.items()}}
        except Exception as error:  # whatever it was, the other attacks are tried all the same
            return {**row, "figures": {}, "failed": f"{type(error).__name__}: {error}", "held": False}
    value = row["figures"][figure]
    row["held"] = (least is None or value >= least) and (most is None or value <= most)
    return row


def knows(tree: Path, option: str) -> bool:
    """Whether the gateway of a checkout has an option."""
    return f'"{option}"' in "".join(file.read_text() for file in (tree / "gateway" / "cli").glob("*.py")) or any(
        option.removeprefix("--") in file.read_text() for file in (tree / "gateway").glob("**/config/keys.py")
    )


def cell(row: Row | None) -> str:
    """Return the judged figure of a run, in bold if it is not permitted."""
    if row is None:
        return "-"
    if "failed" in row:
        return "**failed**"
    value = f"{row['figures'][row['judged']]:g}{UNITS[row['judged']]}"
    return value if row["held"] else f"**{value}**"


def allowed(row: Row) -> str:
    unit = UNITS[row["judged"]]
    return f"≥ {row['least']:g}{unit}" if row["least"] is not None else f"≤ {row['most']:g}{unit}"


def table(runs: list[dict[tuple[str, str, str], Row]], heads: list[str]) -> str:
    """Return a Markdown table in which figures outside their range are bold."""
    keys = list(dict.fromkeys(key for run in runs for key in run))
    lines = [f"| attack | mount | figure | allowed | {' | '.join(heads)} |", f"|---|---|---|---|{'---|' * len(heads)}"]
    group = ""
    for key in keys:
        row = next(run[key] for run in reversed(runs) if key in run)
        if row["group"] != group:
            group = row["group"]
            lines.append(f"| **{group}** |||{'|' * (len(heads) + 1)}")
        cells = " | ".join(cell(run.get(key)) for run in runs)
        model, figure = row["mount"].partition(":")[2], SHOWN[row["judged"]]
        lines.append(f"| {row['attack']} | {model} | {figure} | {allowed(row)} | {cells} |")
    held = " | ".join(f"{sum(row['held'] for row in run.values())} of {len(run)} held" for run in runs)
    return "\n".join([*lines, f"| **all** |||| {held} |"])


def keyed(rows: list[Row]) -> dict[tuple[str, str, str], Row]:
    return {(row["attack"], row["mount"], row["judged"]): row for row in rows}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tree", type=Path, default=HERE)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--at-once", type=int, default=6)
    parser.add_argument("--only", default="")
    parser.add_argument("--alpaca", action="store_true")
    parser.add_argument("--compare", type=Path, nargs=2)
    arguments = parser.parse_args()
    if arguments.compare:
        print(table([keyed(json.loads(file.read_text())) for file in arguments.compare], ["before", "after"]))
        return 0
    tree = arguments.tree.resolve()
    tried = [
        (attack, mount)
        for attack in ATTACKS
        for mount in (
            dict.fromkeys(filter(None, (of_its_kind(attack, mount) for mount in attack.mounts)))
            if arguments.alpaca
            else attack.mounts
        )
        if arguments.only in f"{attack.group} {attack.name} {mount}"
    ]
    with ThreadPoolExecutor(arguments.at_once) as pool:
        rows = list(pool.map(lambda one: once(*one, tree), tried))
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1, ensure_ascii=False))
    print(table([keyed(rows)], ["found"]))
    for row in rows:
        if "failed" in row:
            print(f"{row['attack']}, {row['mount']}: {row['failed']}", file=sys.stderr)
    return 0 if all(row["held"] for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
