"""Maintains the almanac: starts a process that calculates missing days, and stores them for the next start.

The process that serves mounts imports neither astropy nor numpy. All gateways of a user share one file; the holder of
its lock replaces it as a whole, and the next gateway reads it. An almanac that cannot be stored stays in memory. The
keeper checks for missing days every minute; after a failed calculation it waits an hour.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import subprocess
import threading
import time
from collections.abc import Callable, Collection, Iterable
from concurrent.futures import Future
from pathlib import Path

from gateway.astro.ephemeris.almanac import DAY, FIRST_DATE, LAST_DATE, Almanac, decode, load_stored
from gateway.astro.ephemeris.sky import Sky
from gateway.system.files import cache_folder, replace_file
from gateway.system.locks import LockHeld, PidLock
from gateway.system.own_commands import gateway_argv

#: How many days are calculated at once, and for how many days ahead the almanac must always last.
DAYS_PER_CALCULATION, MIN_DAYS_LEFT = 30, 10
#: Seconds: the timeout of the calculating process, between two checks, and until the next attempt after a failure.
TIMEOUT, CHECK_PERIOD, RETRY_PERIOD = 120.0, 60.0, 3600.0
#: The environment of the calculating process: a single thread, and no imports from its current folder.
PROCESS_ENVIRONMENT = {"OPENBLAS_NUM_THREADS": "1", "PYTHONSAFEPATH": "1"}
#: On Windows: lowest priority, and no console window.
POPEN_FLAGS = getattr(subprocess, "IDLE_PRIORITY_CLASS", 0) | getattr(subprocess, "CREATE_NO_WINDOW", 0)


def renew_almanac(days: Iterable[int]) -> tuple[Almanac, str]:
    """Store and return an almanac with these days, and why it was not stored, or "". Raises OSError, ValueError."""
    path, almanac = cache_folder() / "almanac", load_stored()
    lacking = [day for day in days if day not in almanac.days]
    if not lacking:
        return almanac, ""
    almanac = almanac.join(calculate_in_process(lacking)).without_oldest_days()
    lock = PidLock(path.with_name("almanac.lock"), remove=True)
    try:
        if not path.is_absolute():
            raise OSError("there is no home folder")
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        lock.acquire()
        replace_file(path, almanac.encode())
    except LockHeld:
        pass  # another gateway stores the same days now
    except OSError as error:
        return almanac, f"{path}: {error.strerror or error}"
    finally:
        lock.release()
    return almanac, ""


def calculate_in_process(days: Collection[int]) -> Almanac:
    """Return the almanac of these days, which a new process calculates. When this process ends, the standard input of
    the new one closes, and it ends, too. Raises OSError if it cannot start, ValueError if it fails or is too slow.
    """
    argv = [*gateway_argv(), "almanac", "-", "--dates", ",".join(map(str, days))]
    path = os.pathsep.join([str(Path(__file__).parents[3]), os.environ.get("PYTHONPATH", "")]).strip(os.pathsep)
    environment = {**os.environ, **PROCESS_ENVIRONMENT, "PYTHONPATH": path}
    read_end, write_end = os.pipe()
    try:
        done = subprocess.run(
            argv, stdin=read_end, capture_output=True, timeout=TIMEOUT, env=environment, creationflags=POPEN_FLAGS
        )
    except subprocess.TimeoutExpired:
        raise ValueError(f"it took more than {TIMEOUT:.0f} s") from None
    finally:
        os.close(read_end)
        os.close(write_end)
    if done.returncode:
        said = done.stderr.decode(errors="replace").strip().splitlines() or [f"it ended with {done.returncode}"]
        raise ValueError(said[-1][:200])
    return decode(done.stdout)


async def _renew_on_daemon_thread(days: Collection[int]) -> tuple[Almanac, str]:
    """Renew the almanac on a daemon thread: Python would wait for any other thread before it ends the program."""
    done: Future[tuple[Almanac, str]] = Future()
    done.set_running_or_notify_cancel()

    def renew() -> None:
        try:
            done.set_result(renew_almanac(days))
        except Exception as error:
            done.set_exception(error)

    threading.Thread(target=renew, name="almanac", daemon=True).start()
    return await asyncio.wrap_future(done)


class AlmanacKeeper:
    """Keeps a serving process's almanac up to date: call ``open`` first, then run ``run`` as a task. ``all_at_rest``
    returns whether all mounts are at rest.
    """

    def __init__(
        self,
        sky: Sky,
        warn: Callable[[str], object],
        all_at_rest: Callable[[], bool] = lambda: True,
        clock: Callable[[], float] = time.time,
    ) -> None:
        self._sky, self._warn, self._all_at_rest, self._clock = sky, warn, all_at_rest, clock
        #: The almanac loaded at the start, the days calculated in this run, and both joined.
        self._initial_almanac = self._calculated_almanac = self._almanac = Almanac()
        self._given_warnings: set[str] = set()
        self._calculation_requested = asyncio.Event()

    def open(self, named_file: str | None = None) -> None:
        """Load the stored almanac, and the file that the user has named, if any. Raises UserError."""
        self._initial_almanac = load_stored(named_file)
        self._sky.request_almanac = self._calculation_requested.set
        self._use(Almanac())

    async def run(self) -> None:
        """Calculate missing days, and days that will soon be needed, until this task is cancelled."""
        while True:
            self._calculation_requested.clear()
            if days := self._missing_days():
                await asyncio.sleep(CHECK_PERIOD if await self._renew(days) else RETRY_PERIOD)
            else:
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(self._calculation_requested.wait(), CHECK_PERIOD)

    async def _renew(self, days: list[int]) -> bool:
        """Add these days to the almanac; warn and return False if they could not be calculated."""
        try:
            newer, trouble = await _renew_on_daemon_thread(days)
        except Exception as error:  # also if no thread can start: an error that ended this task would be lost
            self._warn_once(
                f"the almanac could not be calculated: {error}. Simpler formulas replace it: the Sun within 0.01 "
                f"degrees, the Moon within 0.04, no planets. The gateway tries again in an hour"
            )
            return False
        if trouble:
            self._warn_once(f"the almanac cannot be stored, so each start calculates it again: {trouble}")
        self._use(newer)
        return True

    def _use(self, newer: Almanac) -> None:
        """Add the days of ``newer``, and let the sky use the joined almanac."""
        self._calculated_almanac = self._calculated_almanac.join(newer).without_oldest_days()
        self._almanac = self._initial_almanac.join(self._calculated_almanac)
        self._sky.use(self._almanac)

    def _missing_days(self) -> list[int]:
        """Return the days to calculate: up to `DAYS_PER_CALCULATION` from each of these days that is missing: today,
        the sky's missing day and, while all mounts are at rest, the day `MIN_DAYS_LEFT` days ahead.
        """
        today = int(self._clock() // DAY)
        starts = {today, self._sky.missing_day or today}
        if self._all_at_rest():
            starts.add(today + MIN_DAYS_LEFT)
        held = self._almanac.days
        days = {start + more for start in starts if start not in held for more in range(DAYS_PER_CALCULATION)}
        return sorted(day for day in days if day not in held and FIRST_DATE <= day * DAY < LAST_DATE)

    def _warn_once(self, message: str) -> None:
        if message not in self._given_warnings:
            self._given_warnings.add(message)
            self._warn(message)
