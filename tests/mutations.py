"""Checks that the tests notice errors: it breaks the gateway in one place after another and lists what stayed unseen.

    python -m tests.mutations [--only WORD ...] [--processes 2]

Each row of ``MUTATIONS`` describes an error, the change of the source that makes it, and the tests that must fail. The
source is found by a regular expression and not by a file's name, so that a module may move. Nothing is changed in
place, only in copies in a temporary folder. ``tests/project/test_mutations.py`` finds a row that no longer matches.
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
#: The parts of a copy, and the time limit of one run, seconds.
PARTS, PATIENCE = (
    ("gateway", "mappings", "tests", "docs", "examples", "pyproject.toml", "README.md", "CHANGELOG.md"),
    300.0,
)


class Mutation(NamedTuple):
    """``old`` is a regular expression with ``places`` matches in ``files``; ``new`` replaces each of them."""

    what: str
    old: str
    new: str
    tests: str
    files: str = "gateway/**/*.py"
    places: int = 1

    def applied(self, root: Path) -> dict[Path, tuple[str, int]]:
        """Return the files below ``root`` that it changes: the text that each is to have, and how often it matched."""
        changed = {}
        for path in sorted(root.glob(self.files)):
            text, matches = re.subn(self.old, self.new, path.read_text("utf-8"), flags=re.MULTILINE)
            if matches:
                changed[path] = text, matches
        return changed


def answer(command: str) -> tuple[str, str]:
    """Return an edit that removes the kind of reply from a request's row, so that its reply is accepted unverified."""
    return rf'(^\["?{re.escape(command)}"?\]\n(?:(?!\[).*\n)*?answer = )"\w+"', r'\g<1>"stream"'


SAFETY, STOPS = "tests/integration/safety", "tests/integration/stops"
READINGS = "tests/integration/readings"
ALTERED = f"{READINGS}/test_altered_answers.py"
TABLES = "mappings/*/commands.toml"
NEXSTAR_SURFACE = "gateway/protocols/nexstar/surface/*.py"
MUTATIONS = [
    # --- cached replies
    Mutation(
        "no cached reply is ever repeated",
        r"(return self\._replies\.get\(command\) if )",
        r"\g<1>False and ",
        f"{READINGS}/test_positions.py",
    ),
    Mutation(
        "a changed reading invalidates no cached reply",
        r"self\.count \+= 1",
        "self.count += 0",
        f"{READINGS}/test_told_alike.py",
        "gateway/core/*.py",
    ),
    Mutation(
        "a cached reply never expires",
        r"self\._valid_until = min\(.*",
        'self._valid_until = float("inf")',
        f"{READINGS}/test_told_alike.py {READINGS}/test_positions.py",
    ),
    # --- accepted replies
    Mutation(
        "the first reply is accepted",
        r'(def _replies_needed\(self, kind.*\n +""".*\n)',
        r"\g<1>        return 1\n",
        ALTERED,
    ),
    Mutation(
        "two replies always agree",
        r'(def _agree\(.*\n +""".*\n)',
        r"\g<1>        return True\n",
        f"{ALTERED} tests/unit/mount/link",
    ),
    *(
        Mutation(f"the reply to {command} is accepted unverified", *answer(command), ALTERED, TABLES)
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
        "a sync that the hand control does not have is forgotten",
        r"mount\.sync_offset = \(wrap180.*",
        "pass",
        "tests/integration/test_driven_models.py",
    ),
    # --- ends of motions
    Mutation(
        "a stop waits in the queue",
        r"^STOP, MOTION, POSITION, AGED_READ, SETTING, READ = range\(6\)",
        "MOTION, POSITION, AGED_READ, SETTING, READ, STOP = range(6)",
        f"{STOPS}/test_stop_first.py",
    ),
    Mutation(
        "an end counts as done once it is sent",
        r"(def next_step\(.*\n.*\n)",
        r"\g<1>    return Step.DONE\n",
        f"{STOPS}/test_lost_stops.py tests/unit/mount/motion",
    ),
    Mutation(
        "orders are carried out by age, ends too",
        r"key=lambda order: \(order\.rank, order\.number\)",
        "key=lambda order: order.number",
        "tests/unit/mount/motion tests/integration/motion/test_goto_whole.py",
    ),
    Mutation(
        "a motion needs no client", r"moments\.append(\(\(motion)", r"\g<1>", f"{SAFETY}/test_dead_man.py", places=2
    ),
    Mutation(
        "the mount is reported at rest without a reading",
        r"(^async def wait_for_rest\(.*\n)",
        r"\g<1>    return\n",
        "tests/unit/mount/readings/test_rest.py",
    ),
    Mutation(
        "nothing is sent first after a reconnect", r"self\.reopened\.emit\(None\)", "pass", f"{STOPS}/test_line_back.py"
    ),
    # --- limits
    Mutation(
        "no altitude is too low or too high",
        r"for rule in \(altitude_rooms, sun_rooms, meridian_rooms\):",
        "for rule in (sun_rooms, meridian_rooms):",
        f"{SAFETY}/test_altitude.py",
    ),
    Mutation("the Sun is always far away", r"(def sun_rooms\(.*\n)", r"\g<1>    return\n", f"{SAFETY}/test_sun.py"),
    Mutation(
        "the meridian is always far away",
        r"(def meridian_rooms\(.*\n)",
        r"\g<1>    return\n",
        f"{SAFETY}/test_hour_angle.py",
    ),
    Mutation(
        "a stalled motor goes unnoticed",
        r"course\.distance < STALL_MIN_PART \* course\.speed \* elapsed",
        "False",
        "tests/unit/mount/safety/test_stalled.py",
    ),
    Mutation(
        "a sync may have any size",
        r"raise SyncTooFar\(",
        "return SyncTooFar(",
        "tests/unit/mount/safety/test_sync_sum.py",
        places=2,
    ),
    Mutation(
        "a sync that makes the sum smaller is refused",
        r"if all\(is_correction\(sync_limit, before, after\) for before, after in zip.*:",
        "if False:",
        "tests/unit/mount/safety/test_sync_sum.py",
    ),
    Mutation(
        "a sync over the pole counts as if the mount kept the way in which it points",
        r"if doubtful and not by_sky:",
        "if False:",
        f"{SAFETY}/test_syncs_over_the_pole.py",
    ),
    Mutation(
        "nobody notices that a tube has passed the pole or the zenith",
        r"abs\(wrap180\(after\[0\] - before\[0\]\)\) > POLE_PASSAGE_TURN",
        "False",
        f"{SAFETY}/test_syncs_over_the_pole.py",
    ),
    Mutation(
        "an arrow and tracking are not judged by where the tube is if the syncs were wrong",
        r"for shift in frame\.shifts:\n        yield AltitudeSource",
        "for shift in ():\n        yield AltitudeSource",
        "tests/integration/safety/test_after_syncs.py",
    ),
    Mutation(
        "a guide pulse of any length is checked step by step",
        r"if not all\(abs\(degrees\) <= MAX_AXIS_TURN for degrees in turns\.values\(\)\):",
        "if False:",
        "tests/unit/mount/safety/test_ends_on_any_input.py",
    ),
    Mutation(
        "a client widens the highest altitude",
        r"else min\(self\.highest, highest\)",
        "else highest",
        "tests/unit/protocols/lx200/surface/test_target.py",
    ),
    Mutation(
        "tracking that the hand control ignored stays off",
        r"is not wanted and not operation\.was_confirmed:",
        "is not wanted and False:",
        "tests/integration/tracking/test_tracking_at_the_keys.py",
    ),
    Mutation(
        "tracking that its owner turned off is turned on again",
        r"is not wanted and not operation\.was_confirmed:",
        "is not wanted:",
        "tests/integration/tracking/test_tracking_at_the_keys.py",
    ),
    Mutation(
        "no margin for the rate at which a limit comes nearer",
        r"left < self\.stop_margin\(rate\) - room\.tolerance",
        "left < 0.0",
        "tests/unit/mount/safety/test_safety_rules.py",
    ),
    Mutation(
        "a goto at the mount's own keys counts as an order",
        r"self\._ordered_by_client = self\.ordered_by_client$",
        "self._ordered_by_client = self.anything",
        f"{SAFETY}/test_at_the_keys.py",
    ),
    Mutation(
        "a negative rate moves an axis the same way",
        r"1 if rate > 0\.0 else -1, op\.Rate",
        "1, op.Rate",
        "tests/unit/protocols/alpaca/test_refusals.py",
    ),
    *(
        Mutation(
            f"{fault} has another number of ASCOM's",
            rf"^{fault} = \{{ number = 0x\w+ \}}",
            f"{fault} = {{ number = 0x5F0 }}",
            "tests/unit/protocols/alpaca/test_error_numbers.py",
            "mappings/alpaca/errors.toml",
        )
        for fault in ("Held", "NearSun", "TooHigh", "NoDevice", "Silence")
    ),
    # --- one cache, one vocabulary, one state
    Mutation(
        "a reply in the mount's own words is shared after an order",
        r"entry\.value if entry\.order_count == self\.order_count or isinf\(entry\.fresh_for\)",
        "entry.value if True",
        "tests/integration/sharing tests/integration/settings tests/integration/lx200",
    ),
    Mutation(
        "a reading that was forgotten is told",
        r"(def fresh_answer\(.*\n(?:.*\n){5,6}?        if entry is None) or entry\.forgotten:",
        r"\g<1>:",
        f"{READINGS} tests/unit/mount/readings tests/integration/stops",
    ),
    Mutation(
        "a position from before the last order is told",
        r"self\.outdated_before = now\n",
        "pass\n",
        f"{READINGS} tests/integration/motion",
    ),
    Mutation(
        "a program that has set its own site is told the mount's",
        r"return read\.has_own_clock\(\) if .*",
        "return False",
        "tests/integration/sharing tests/integration/settings",
    ),
    Mutation(
        "who cancels a request ends another's motion",
        r"if not self\._has_motion\(active\):\n            return Answer\(DONE, \"nothing",
        'if False:\n            return Answer(DONE, "nothing',
        "tests/unit/app/control/test_requests.py",
    ),
    Mutation(
        "the release of an arrow ends a newer arrow of another",
        r"if active\.arrow is not None and self\._owns_arrow\(active\):\n            by",
        "if active.arrow is not None:\n            by",
        "tests/unit/console tests/unit/app/control",
    ),
    Mutation(
        "an arrow that is kept pressed goes on after a stop",
        r"if active\.stop_count != self\._controller\.stop_count:\n            raise Stopped\n        "
        r"if active\.arrow ==",
        "if active.arrow ==",
        "tests/unit/console tests/unit/app/control tests/integration/stops",
    ),
    Mutation(
        "a request that comes after its cancellation is begun",
        r"if active\.cancel_event\.is_set\(\):\n            raise Busy",
        "if False:\n            raise Busy",
        "tests/unit/app/control/test_requests.py",
    ),
    Mutation(
        "the position that was found for a name is not used",
        r"request = replace\(request, where=await",
        "replace(request, where=await",
        "tests/unit/app/control/test_requests.py",
    ),
    Mutation(
        "a program that may only look may move the mount",
        r"Rights\(self\.access\.is_read_only\(host\),",
        "Rights(False,",
        "tests/unit/clients tests/integration/sharing tests/unit/console",
    ),
    Mutation(
        "what a connection has left is inherited for ever",
        r"state if self\.controller\.now\(\) - at <= MAX_STATE_AGE else None",
        "state",
        "tests/unit/protocols/lx200/surface/test_sessions.py",
    ),
    Mutation(
        "what is told in advance does not know the limits",
        r"await rules\._admit\(op\.Goto\(goal\.ra, goal\.dec\)\)",
        "pass",
        "tests/property/test_preview.py",
    ),
    Mutation(
        "to tell in advance marks the path as checked",
        r"CheckedPath\(\) if is_preview else watch\.next_path",
        "watch.next_path",
        "tests/property/test_preview.py tests/unit/console",
    ),
    Mutation(
        "a damaged almanac is believed",
        r"if zlib\.crc32\(data\[start:\]\) != .*:",
        "if False:",
        "tests/unit/astro/test_almanac.py",
    ),
    Mutation(
        "an almanac that another user can write is believed",
        r"stat\.S_IMODE\(status\.st_mode\) & 0o022",
        "False",
        "tests/unit/astro/test_almanac.py",
    ),
    Mutation(
        "an almanac that cannot be stored is forgotten",
        r"self\._calculated_almanac = self\._calculated_almanac\.join\(newer\)\.without_oldest_days\(\)",
        "self._calculated_almanac = newer",
        "tests/unit/astro/test_almanac.py",
    ),
    Mutation(
        "a real mount is in a hurry",
        r"return speed if elsewhere or endpoint\.where == \"sim\" else 1\.0",
        "return speed",
        "tests/unit/app/test_simulated_speed.py",
    ),
    Mutation(
        "an order that is being sent is shown as one that waits",
        r"if not order\.follow_up and order\.number != wanted\.active:",
        "if not order.follow_up:",
        "tests/unit/app/control",
    ),
    Mutation("a mount on hold can be moved", r"raise Held$", "return", "tests/unit/app/test_hold.py"),
    # --- what one unit test or judge proves where several did
    Mutation(
        "an Alpaca mount that still slews is at its park position",
        r"return moves\.parked and not \(yield from _is_slewing\(moves\)\)",
        "return moves.parked",
        "tests/conformance/test_alpaca_evening.py",
    ),
    Mutation(
        "a Meade program's clock is set before its date has come",
        r"session\.clock\(\) - _get_draft\(session\)\.changed_at >= DRAFT_PAUSE - 0\.1",
        "True",
        "tests/unit/protocols/lx200/surface",
    ),
    Mutation(
        "the offset of a Meade's clock has the sign of a time zone",
        r"-round_to_half_hour\(offset\)\}",
        "round_to_half_hour(offset)}",
        "tests/unit/protocols/lx200/surface",
    ),
    Mutation(
        "a NexStar command is given up in the middle of a slow program's bytes",
        r"^END_WINDOW = 3\.0",
        "END_WINDOW = 0.5",
        "tests/unit/protocols/nexstar",
    ),
    Mutation(
        "a question mark begins a NexStar command",
        r'^STRAY_BYTES = frozenset\(b"#\? ',
        'STRAY_BYTES = frozenset(b"# ',
        "tests/unit/protocols/nexstar",
    ),
    Mutation(
        "readings wait for settings without end",
        r"self\._setting_skips = 0 if request\.priority == SETTING else self\._setting_skips \+ 1",
        "pass",
        "tests/unit/mount/link/test_queue.py",
    ),
    Mutation(
        "a place of J2000 is taken for one of date",
        r"elif target\.j2000:",
        "elif False:",
        "tests/unit/app/test_mount.py",
    ),
    Mutation(
        "a connection that is half closed gets no late reply",
        r"if self\._handler is None or self\._handler\.all_answered:",
        "if True:",
        "tests/unit/clients/test_clients_that_are_gone.py",
        "gateway/transport/tcp.py",
    ),
    Mutation(
        "a client counts as answered while its reply is owed",
        r"return self\.client\.all_answered$",
        "return True",
        "tests/unit/clients/test_clients_that_are_gone.py",
    ),
    Mutation(
        "a search that a signal ends goes on",
        r"for future in \(end, working\):",
        "for future in (end,):",
        "tests/unit/cli/test_config_cli.py",
    ),
    Mutation(
        "an older answer of an HTTP server counts as the newest",
        r"if session is self\._session and request_number == self\._last_request_number:",
        "if session is self._session:",
        "tests/unit/transport/test_http_wire.py",
    ),
    Mutation(
        "what a late client had sent before its end brings it back",
        r"^        self\._peer_closed = True$",
        "        pass",
        "tests/unit/clients/test_clients_that_are_gone.py",
        "gateway/clients/*.py",
    ),
    # --- what one test plays where several did
    Mutation(
        "M of a NexStar program ends no goto",
        r"^    yield FireAndForget\(op\.AbortSlew\(\)\)",
        "    yield from ()",
        f"{STOPS}/test_lost_answers.py",
        NEXSTAR_SURFACE,
    ),
    Mutation(
        "a goto of a NexStar program goes beside its goal",
        r"op\.Goto\(\*fold_declination\(values\[\"ra\"\], values\[\"dec\"\]\)\)",
        'op.Goto(*fold_declination(values["ra"], values["dec"] + 0.1))',
        "tests/integration/nexstar/test_surface_flow.py",
        NEXSTAR_SURFACE,
    ),
    Mutation(
        "a sync of a NexStar program is not done",
        r"yield from attempt\(op\.Sync\(.*",
        "yield from ()",
        "tests/integration/lx200/test_other_makers.py",
        NEXSTAR_SURFACE,
    ),
    Mutation(
        "T 0 of a NexStar program leaves tracking on",
        r"on=wanted is not op\.Tracking\.OFF, mode=wanted",
        "on=True, mode=wanted",
        "tests/integration/lx200/test_driver.py tests/integration/tracking",
        NEXSTAR_SURFACE,
    ),
    Mutation(
        "a motor command of a NexStar program turns the other way",
        r"\(1 if sense == \"pos\" else -1\)",
        '(1 if sense == "neg" else -1)',
        "tests/integration/motion/test_directions.py",
        NEXSTAR_SURFACE,
    ),
    Mutation(
        "rate 0 of one axis halts both",
        r"yield FireAndForget\(op\.StopAxis\(axis\)\)\n    elif values",
        "yield FireAndForget(op.AbortMotion())\n    elif values",
        "tests/integration/nexstar/test_surface_flow.py",
        NEXSTAR_SURFACE,
    ),
    Mutation(
        "the Sun is avoided only where the best clock puts it",
        r"for time in self\._sources\.times\(\)\]$",
        "for time in self._sources.times()[:1]]",
        f"{SAFETY}/test_instrument.py",
    ),
    Mutation(
        "the Sun is avoided by where the mount believes to point",
        r"for shift in frame\.shifts or \(\(None,\) if risen is not known else \(\)\):",
        "for shift in (None,) if risen is not known else ():",
        f"{SAFETY}/test_instrument.py",
    ),
    Mutation(
        "a command of any length is kept",
        r"if len\(self\._frame\) > MAX_COMMAND_LENGTH:",
        "if False:",
        "tests/unit/protocols/lx200/surface/test_unterminated.py",
    ),
    Mutation(
        "the second motor of a Meade turns the other way",
        r'return "n" if sense > 0 else "s"',
        'return "s" if sense > 0 else "n"',
        "tests/integration/motion/test_directions.py tests/integration/lx200/test_driver.py",
    ),
    # --- the layers
    Mutation(
        "a lower layer imports a higher one",
        r"(\Z)",
        "\n\ndef _main() -> object:\n    from gateway.cli import main\n\n    return main\n",
        "tests/project/test_structure.py",
        "gateway/core/errors.py",
    ),
]


class Outcome(NamedTuple):
    """``seen``: whether the tests failed. ``words``: how."""

    seen: bool
    words: str


@contextmanager
def changed(copy: Path, mutation: Mutation) -> Iterator[int]:
    """Change the files and yield the number of places; restore the files afterwards."""
    applied = mutation.applied(copy)
    before = {path: path.read_text("utf-8") for path in applied}
    for path, (text, _) in applied.items():
        path.write_text(text, "utf-8")
    try:
        yield sum(matches for _, matches in applied.values())
    finally:
        for path, text in before.items():
            path.write_text(text, "utf-8")


def red(copy: Path, tests: str, workers: int = 0, patience: float = PATIENCE) -> Outcome:
    """Run tests on a copy until the first one fails."""
    options = ["-q", "-x", f"-n{workers}", "-p", "no:cacheprovider"]
    command = [sys.executable, "-B", "-bb", "-m", "pytest", *options, *tests.split()]
    try:
        done = subprocess.run(command, cwd=copy, capture_output=True, text=True, timeout=patience, check=False)
    except subprocess.TimeoutExpired:
        return Outcome(True, "the tests do not end")
    failed = re.search(r"^(?:FAILED|ERROR) (\S+::\S+)", done.stdout, re.MULTILINE)
    if failed:
        return Outcome(True, failed[1])
    if done.returncode == 0:
        return Outcome(False, "all tests pass")
    return Outcome(False, f"no test could be run: {(done.stdout + done.stderr).strip()[-300:]}")


def play(mutation: Mutation, copies: SimpleQueue[Path]) -> Outcome:
    """Try one mutation in a copy that no other thread uses meanwhile."""
    copy = copies.get()
    try:
        with changed(copy, mutation) as places:
            if places != mutation.places:
                return Outcome(False, f"its expression matches {places} places, not {mutation.places}")
            return red(copy, mutation.tests)
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
        folders = [_copy(Path(folder) / str(number)) for number in range(arguments.processes)]
        tests = sorted({test for one in chosen for test in one.tests.split()})
        untouched = red(folders[0], " ".join(tests), 2 * arguments.processes, len(chosen) * PATIENCE)
        if untouched != Outcome(False, "all tests pass"):
            print(f"the tests fail before anything is broken: {untouched.words}", file=sys.stderr)
            return 2
        copies: SimpleQueue[Path] = SimpleQueue()
        for copy in folders:
            copies.put(copy)
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
