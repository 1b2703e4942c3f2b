"""Keeps the almanac: reads it, lets a process of its own calculate what is missing, and stores it for the next start.

The process serving mounts imports neither astropy nor numpy. All gateways of a user share one file, which is replaced
as a whole by whoever holds its lock; the next then finds there what it wanted. Where it cannot be stored, it is kept in
memory. What fails is told once and tried again after an hour, at most three times a day. For dates that programs set
there are six processes an hour.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import stat
import subprocess
import threading
import time
from collections.abc import Callable, Collection, Iterable
from concurrent.futures import Future
from pathlib import Path
from typing import TypeVar

from gateway.astro.ephemeris.almanac import Almanac, decoded, read
from gateway.astro.ephemeris.day_table import DAY
from gateway.astro.ephemeris.sky import FROM, TO, Sky
from gateway.core.errors import UserError, told
from gateway.system.files import cache_directory, replace_file
from gateway.system.locks import LockHeld, PidLock
from gateway.system.own_commands import gateway_argv
from gateway.system.runtime_folders import user

#: Days of an almanac, and of them those left when the next are calculated; days for another date than today's; how many
#: of such days, and of sites, are stored.
AHEAD, LEFT, OTHERS, STORED = 40, 10, 4, 32
#: Seconds that the process may take; that a failed attempt is not repeated; between two looks, and two processes.
LONGEST, AGAIN, LOOK, PAUSE = 120.0, 3600.0, 60.0, 2.0
#: Attempts that may fail in a day; processes for other dates than the next ones in an hour.
ATTEMPTS, ON_DEMAND = 3, 6
#: One thread, which gives way to everything else, and no modules from the folder it was started in.
ENVIRONMENT = {"OPENBLAS_NUM_THREADS": "1", "PYTHONSAFEPATH": "1"}
#: The same on Windows, and no window.
FLAGS = getattr(subprocess, "IDLE_PRIORITY_CLASS", 0) | getattr(subprocess, "CREATE_NO_WINDOW", 0)
#: The name of the command line's command that calculates an almanac.
COMMAND = "almanac"

_T = TypeVar("_T")


def stored(named: str | None = None) -> Almanac:
    """Return the almanac in this user's cache folder, with that of a file that the user has ``named``.

    It is empty if there is none that can be used; for the named one this raises UserError.
    """
    try:
        almanac = read(cache_directory() / "almanac")
    except (OSError, ValueError):
        almanac = Almanac()
    try:
        return almanac if named is None else almanac.joined(read(Path(named).expanduser()))
    except (OSError, ValueError) as error:
        raise UserError(f"--almanac {named}: {told(error) if isinstance(error, OSError) else error}") from None


def renewed(today: int, days: Iterable[int], sites: Iterable[str] = ()) -> tuple[Almanac, str]:
    """Return an almanac with these days and sites, and why it could not be stored. Raises OSError, ValueError."""
    path, trouble = cache_directory() / "almanac", ""
    lock = PidLock(path.with_name("almanac.lock"), remove=True)
    try:
        _make_folder(path.parent)
        _wait(lock)
    except OSError as error:
        trouble = f"{path.parent}: {error.strerror or error}"
    try:
        almanac = stored()
        lacking = [day for day in days if day not in almanac.days]
        unknown = [site for site in sites if site not in almanac.sites]
        if lacking or unknown:
            almanac = _joined(almanac, calculated(lacking, unknown), today)
            if not trouble:
                try:
                    replace_file(path, almanac.encoded())
                except OSError as error:
                    trouble = f"{path}: {error.strerror or error}"
        return almanac, trouble
    finally:
        lock.release()


def _joined(almanac: Almanac, newer: Almanac, today: int) -> Almanac:
    """Return both, without what is not needed any more."""
    return almanac.joined(newer).only(today - 1, today + 2 * AHEAD, STORED)


def _wait(lock: PidLock) -> None:
    """Acquire a lock, which its holder releases in a while. Raises OSError."""
    for _ in range(int(LONGEST * 10.0)):
        try:
            return lock.acquire()
        except LockHeld:
            time.sleep(0.1)
    raise OSError("another process is writing there")


def _make_folder(folder: Path) -> None:
    """Create the cache folder if it is missing. Raises OSError if it is none in which only this user can write."""
    if not folder.is_absolute():
        raise OSError("there is no home folder")
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    seen = folder.lstat()
    if not stat.S_ISDIR(seen.st_mode):
        raise OSError("is not a folder")
    if user() is not None and (seen.st_uid != user() or seen.st_mode & 0o022):
        raise OSError("other users can write there")


def calculated(days: Collection[int], sites: Collection[str]) -> Almanac:
    """Let a process calculate an almanac. Raises OSError, ValueError if it fails or takes too long.

    It ends when this process does, however that ends: its input is a pipe that nobody writes to.
    """
    words = [*gateway_argv(), COMMAND, "-", "--dates", ",".join(map(str, days)), *(f"--site={site}" for site in sites)]
    path = os.pathsep.join([str(Path(__file__).parents[3]), os.environ.get("PYTHONPATH", "")]).strip(os.pathsep)
    environment = {**os.environ, **ENVIRONMENT, "PYTHONPATH": path}
    its_input, held = os.pipe()
    try:
        done = subprocess.run(
            words, stdin=its_input, capture_output=True, timeout=LONGEST, env=environment, creationflags=FLAGS
        )
    except subprocess.TimeoutExpired:
        raise ValueError(f"it took more than {LONGEST:.0f} s") from None
    finally:
        os.close(its_input)
        os.close(held)
    if done.returncode:
        said = done.stderr.decode(errors="replace").strip().splitlines() or [f"it ended with {done.returncode}"]
        raise ValueError(said[-1][:200])
    return decoded(done.stdout)


async def _on_daemon(work: Callable[[], _T]) -> _T:
    """Wait for work on a thread that ends with its program: for others Python waits before that can stop its mount."""
    done: Future[_T] = Future()
    done.set_running_or_notify_cancel()

    def run() -> None:
        try:
            done.set_result(work())
        except Exception as error:
            done.set_exception(error)

    threading.Thread(target=run, name="almanac", daemon=True).start()
    return await asyncio.wrap_future(done)


class AlmanacKeeper:
    """Keeps the almanac of a process that serves mounts: ``open`` it first, then run ``keep`` until the end.

    ``quiet``: whether nothing moves; ``exact`` is called once today's tables are in use; ``enter`` calls a function as
    input from outside.
    """

    def __init__(
        self,
        sky: Sky,
        warn: Callable[[str], object],
        exact: Callable[[], object] = lambda: None,
        quiet: Callable[[], bool] = lambda: True,
        enter: Callable[[Callable[[], object]], object] | None = None,
        clock: Callable[[], float] = time.time,
    ) -> None:
        self._sky, self._warn, self._exact, self._quiet = sky, warn, exact, quiet
        self._enter = enter or (lambda act: act())
        self._clock = clock
        self._almanac = Almanac()
        #: When an attempt failed, and when one for another date began: monotonic time.
        self._failed: list[float] = []
        self._on_demand: list[float] = []
        self._told: set[str] = set()
        self._asked = asyncio.Event()

    @property
    def _today(self) -> int:
        return int(self._clock() // DAY)

    def open(self, named: str | None = None) -> None:
        """Use the stored almanac, and that of a file that the user has ``named``. Raises UserError."""
        self._use(stored(named))
        self._sky.ask = self._asked.set

    async def keep(self) -> None:
        """Calculate what is missing or will soon be, until this is cancelled."""
        while True:
            self._asked.clear()
            if (days := self._wanted()) and self._may_try():
                await self._renew(days)
                await asyncio.sleep(PAUSE)
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._asked.wait(), LOOK)

    async def _renew(self, days: list[int]) -> None:
        today = self._today
        if self._others.intersection(days):
            self._on_demand.append(time.monotonic())
        try:
            newer, trouble = await _on_daemon(lambda: renewed(today, days))
        except Exception as error:  # also that there is no room for a thread: without the keeper, nothing would tell it
            self._failed.append(time.monotonic())
            self._tell_once(
                f"the almanac could not be calculated: {error}. Where it has no tables, simpler formulas are used: the "
                "Sun within 0.01 degrees, the Moon within 0.04, no planets. It is tried again in an hour"
            )
            return
        if trouble:
            self._tell_once(f"the almanac cannot be stored, so each start calculates it again: {trouble}")
        self._enter(lambda: self._use(_joined(self._almanac, newer, today)))

    def _use(self, almanac: Almanac) -> None:
        known, self._almanac = self._today in self._almanac.days, almanac
        if almanac.days:
            self._sky.use(almanac)
        if not known and self._today in almanac.days:
            self._exact()

    @property
    def _ahead(self) -> range:
        return range(self._today, self._today + AHEAD)

    @property
    def _others(self) -> set[int]:
        """The days without tables that are needed and are not among the next ones: a program has set another date."""
        return self._sky.missing.difference(self._ahead)

    def _wanted(self) -> list[int]:
        """Return the days to calculate now."""
        held, missing = self._almanac.days, self._sky.missing
        if self._others and not self._may_serve_others():
            missing = missing - self._others
        wanted = {day + more for day in missing for more in range(OTHERS)}
        left = self._almanac.days_from(self._today)
        if left < LEFT and (not left or self._quiet()):
            wanted.update(self._ahead)
        return sorted(day for day in wanted if day not in held and FROM <= day * DAY < TO)

    def _may_serve_others(self) -> bool:
        """Whether another date may be calculated for; tell it if not."""
        now = time.monotonic()
        self._on_demand = [at for at in self._on_demand if now - at < AGAIN]
        if len(self._on_demand) < ON_DEMAND:
            return True
        self._tell_once(
            f"programs have set {ON_DEMAND} other dates within an hour: for the next ones, simpler formulas are used "
            "until the hour is over (the Sun within 0.01 degrees, the Moon within 0.04, no planets)"
        )
        return False

    def _may_try(self) -> bool:
        now = time.monotonic()
        self._failed = [at for at in self._failed if now - at < DAY]
        return len(self._failed) < ATTEMPTS and (not self._failed or now - self._failed[-1] >= AGAIN)

    def _tell_once(self, words: str) -> None:
        if words not in self._told:
            self._told.add(words)
            self._warn(words)
