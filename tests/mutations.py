"""Whether the tests would notice: breaks the gateway in one place after another, and says which breakage stayed unseen.

    python -m tests.mutations [--only WORD ...] [--processes 2]

Each line of ``MUTATIONS`` says what is broken, what of the source is replaced by what, and which tests must turn red.
The source is looked for by its words and not by a file's name, so that a module may move. Nothing is changed in place:
copies in a temporary folder are. A line whose words are found nowhere is told of like one that survived.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from queue import SimpleQueue
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
#: What a copy consists of, and the patience with one run, seconds.
PARTS, PATIENCE = ("gateway", "mappings", "tests", "docs", "pyproject.toml", "README.md", "CHANGELOG.md"), 300.0


class Mutation(NamedTuple):
    """``old`` is a regular expression, looked for in ``files``; every place where it fits is changed."""

    what: str
    old: str
    new: str
    tests: str
    files: str = "gateway/**/*.py"


def answer(command: str) -> tuple[str, str]:
    """The row of a question no longer says of which kind its answer is, so that it is believed as it comes."""
    return rf'(^\["?{re.escape(command)}"?\]\n(?:(?!\[).*\n)*?answer = )"\w+"', r'\g<1>"stream"'


SAFETY, STOPS = "tests/integration/safety", "tests/integration/stops"
READINGS = "tests/integration/readings"
ALTERED = f"{READINGS}/test_altered_answers.py"
TABLES = "mappings/*/commands.toml"
MUTATIONS = [
    # --- replies that are told again
    Mutation(
        "no reply is ever told again",
        r"(return self\._replies\.get\(command\) if )",
        r"\g<1>False and ",
        f"{READINGS}/test_positions.py",
    ),
    Mutation(
        "a change of what was read outdates no reply",
        r"self\.count \+= 1",
        "self.count += 0",
        f"{READINGS}/test_told_alike.py",
    ),
    Mutation(
        "a reply is told again however old it is",
        r"self\._until = min\(.*",
        'self._until = float("inf")',
        f"{READINGS}/test_told_alike.py {READINGS}/test_positions.py",
    ),
    # --- answers that are believed
    Mutation(
        "whatever comes first is believed",
        r'(def _replies_needed\(self, kind.*\n +""".*\n)',
        r"\g<1>        return 1\n",
        ALTERED,
    ),
    Mutation(
        "two answers agree always",
        r'(def _agree\(.*\n +""".*\n)',
        r"\g<1>        return True\n",
        f"{ALTERED} tests/unit/mount/link",
    ),
    *(
        Mutation(f"the answer to {command} is believed as it comes", *answer(command), ALTERED, TABLES)
        for command in ("p", "GW", "h?", "gps_linked", "guide_rate")
    ),
    Mutation(
        "every hand control guides at 0.9",
        r'return answer\["rate"\] / 256\.0',
        "return 0.9",
        "tests/integration/test_driven_models.py tests/integration/motion/test_guide_rates.py",
    ),
    Mutation("every tube is on the east side", r'answer\["side"\]', '"E"', "tests/integration/test_driven_models.py"),
    Mutation(
        "a Meade has no name of its own",
        r"product=mount\.product or ",
        "product=",
        "tests/integration/test_driven_models.py",
    ),
    Mutation(
        "a hand control has another version",
        r"version=mount\.version_text",
        'version="4.99"',
        "tests/integration/test_driven_models.py",
    ),
    Mutation(
        "a sync of a hand control without one is forgotten",
        r"mount\.offset = \(wrap180.*",
        "pass",
        "tests/integration/test_driven_models.py",
    ),
    # --- what ends a motion
    Mutation(
        "a stop waits for its turn",
        r"^STOP, MOTION, POSITION, WAITED, SETTING, READ = range\(6\)",
        "MOTION, POSITION, WAITED, SETTING, READ, STOP = range(6)",
        f"{STOPS}/test_stop_first.py",
    ),
    Mutation(
        "an end counts as done when it was sent",
        r"(def next_step\(.*\n.*\n)",
        r"\g<1>    return Step.DONE\n",
        f"{STOPS}/test_lost_stops.py tests/unit/mount/motion",
    ),
    Mutation(
        "what was asked for first is done first, ends too",
        r"key=lambda order: \(order\.rank, order\.number\)",
        "key=lambda order: order.number",
        "tests/unit/mount/motion tests/integration/motion/test_goto_whole.py",
    ),
    Mutation(
        "nobody need be there while a mount moves", r"found\.append(\(\(motion)", r"\g<1>", f"{SAFETY}/test_dead_man.py"
    ),
    Mutation(
        "stopped is said without a look",
        r"(^async def come_to_rest\(.*\n)",
        r"\g<1>    return\n",
        "tests/unit/mount/readings/test_rest.py",
    ),
    Mutation(
        "nothing is sent first when the line is back",
        r"self\.reopened\.emit\(words\)",
        "pass",
        f"{STOPS}/test_line_back.py",
    ),
    # --- limits
    Mutation(
        "nothing is too low and nothing too high",
        r"return sinking or rising",
        "return False",
        f"{SAFETY}/test_altitude.py",
    ),
    Mutation("the Sun is far away", r"(def near_sun\(.*\n.*\n)", r"\g<1>    return ALLOWED\n", f"{SAFETY}/test_sun.py"),
    Mutation(
        "the meridian is far away",
        r"(def meridian\(.*\n.*\n)",
        r"\g<1>    return ALLOWED\n",
        f"{SAFETY}/test_hour_angle.py",
    ),
    Mutation(
        "a motor that stalls goes unnoticed",
        r"course\.seen < PART \* course\.speed \* elapsed",
        "False",
        "tests/unit/mount/safety/test_stalled.py",
    ),
    Mutation(
        "a sync may lead anywhere",
        r"raise SyncTooFar\(",
        "return SyncTooFar(",
        "tests/unit/mount/safety/test_sync_sum.py",
    ),
    Mutation("a mount that is held can be moved", r"raise Held$", "return", "tests/unit/app/test_hold.py"),
    # --- the layers
    Mutation(
        "what is below knows what is above",
        r"(\Z)",
        "\n\ndef _main() -> object:\n    from gateway.cli import main\n\n    return main\n",
        "tests/project/test_structure.py",
        "gateway/core/errors.py",
    ),
]


class Outcome(NamedTuple):
    """``seen``: the tests turned red. ``words``: what to say of it."""

    seen: bool
    words: str


@contextmanager
def changed(copy: Path, mutation: Mutation) -> Iterator[int]:
    """-> the number of places; they are as they were afterwards."""
    before: dict[Path, str] = {}
    places = 0
    for path in sorted(copy.glob(mutation.files)):
        text = path.read_text("utf-8")
        mutated, found = re.subn(mutation.old, mutation.new, text, flags=re.MULTILINE)
        if found:
            before[path] = text
            path.write_text(mutated, "utf-8")
            places += found
    try:
        yield places
    finally:
        for path, text in before.items():
            path.write_text(text, "utf-8")


def red(copy: Path, tests: str) -> Outcome:
    """Run tests against a copy until the first one fails."""
    command = [sys.executable, "-B", "-bb", "-m", "pytest", "-q", "-x", "-n0", "-p", "no:cacheprovider", *tests.split()]
    try:
        done = subprocess.run(command, cwd=copy, capture_output=True, text=True, timeout=PATIENCE, check=False)
    except subprocess.TimeoutExpired:
        return Outcome(True, "the tests come to no end")
    failed = re.search(r"^(?:FAILED|ERROR) (\S+::\S+)", done.stdout, re.MULTILINE)
    if failed:
        return Outcome(True, failed[1])
    if done.returncode == 0:
        return Outcome(False, "all tests pass")
    return Outcome(False, f"no test could be run: {(done.stdout + done.stderr).strip()[-300:]}")


def play(mutation: Mutation, copies: SimpleQueue[Path]) -> Outcome:
    """One mutation in a copy that nobody else uses meanwhile."""
    copy = copies.get()
    try:
        with changed(copy, mutation) as places:
            return red(copy, mutation.tests) if places else Outcome(False, "its words are found nowhere")
    finally:
        copies.put(copy)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--only", nargs="*", default=[], metavar="WORD", help="mutations whose description has one")
    parser.add_argument("--processes", type=int, default=2)
    arguments = parser.parse_args()
    chosen = [one for one in MUTATIONS if not arguments.only or any(word in one.what for word in arguments.only)]
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        copies: SimpleQueue[Path] = SimpleQueue()
        for number in range(arguments.processes):
            copies.put(_copy(Path(folder) / str(number)))
        untouched = Mutation(
            "nothing", r"\A", "", " ".join(sorted({test for one in chosen for test in one.tests.split()}))
        )
        if not play(untouched, copies).words.startswith("all tests pass"):
            print("the tests fail before anything is broken: make them pass first", file=sys.stderr)
            return 2
        with ThreadPoolExecutor(arguments.processes) as pool:
            outcomes = list(pool.map(lambda one: play(one, copies), chosen))
    for mutation, outcome in zip(chosen, outcomes, strict=True):
        print(f"{'seen    ' if outcome.seen else 'SURVIVES'}  {mutation.what}: {outcome.words}")
    survivors = sum(not outcome.seen for outcome in outcomes)
    print(f"{len(chosen)} mutations, {survivors} survive, {time.monotonic() - began:.0f} s")
    return 1 if survivors else 0


def _copy(to: Path) -> Path:
    to.mkdir()
    for part in PARTS:
        if (ROOT / part).is_dir():
            shutil.copytree(ROOT / part, to / part, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(ROOT / part, to / part)
    return to


if __name__ == "__main__":
    sys.exit(main())
