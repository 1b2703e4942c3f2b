"""The tables of the days that are asked for, and who works them out when.

After `start` nobody waits: a day without tables is asked for, and whoever asked does without. The thread works out
that day and the next one, so that midnight finds its tables. After `load` alone (tests, a replay, a rehearsal) a table
is worked out when it is asked for: the same question, the same answer.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from gateway.astro.ephemeris.day_table import DAY, PARTS, DayTable
from gateway.astro.offline import go_offline

TYPE_CHECKING = False  # importing `typing` is more work than importing all this
if TYPE_CHECKING:
    from queue import SimpleQueue

_FROM = -2208988800.0  # 1900-01-01
_TO = 4102444800.0  # 2100-01-01
_DAYS_ASKED = 4  # that may wait to be worked out: a program that sets clocks about piles up no work
_TABLES_KEPT = 16 * len(PARTS)  # the days at hand: the host's clock, the mount's, a replayed transcript's


class TableLoader:
    """``table`` finds what there is; ``start``, ``use`` and ``load`` decide how it gets there."""

    def __init__(self) -> None:
        self._make: Callable[[str, int], DayTable] | None = None
        self._in_use = True
        self._tables: dict[tuple[str, int], DayTable] = {}
        self._queue: SimpleQueue[int] | None = None
        self._asked: set[int] = set()
        self.failure = ""
        """Why astropy could not be loaded, in words; empty while all is well."""

    @property
    def ready(self) -> bool:
        """True once astropy's answers are in use."""
        return self._make is not None and self._in_use

    def start(self, done: Callable[[], object] | None = None) -> None:
        """Load astropy on a daemon thread, which then works out the days that are asked for; returns at once.

        Where the thread calls ``done`` after the first days, its tables are not in use before somebody calls ``use``.
        """
        import threading  # with what `load` imports, all that would make this module slow to import
        from queue import SimpleQueue

        self._in_use, self._queue = done is None, SimpleQueue()
        self._ask(int(time.time() // DAY))
        threading.Thread(target=self._work, args=(self._queue, done), name="sky", daemon=True).start()

    def use(self) -> None:
        """From now on astropy's answers are given."""
        self._in_use = True

    def load(self) -> None:
        """What `start` does first, in the caller's own time. Never raises: sets `ready`, or `failure`."""
        try:
            go_offline()
            from gateway.astro.ephemeris.by_astropy import day_table

            for part in PARTS:  # so that a fault shows here and not in a command
                day_table(part, 0)
            self._make = day_table
        except Exception as fault:  # whatever a broken installation can raise; closed forms go on
            self.failure = f"astronomy stays approximate: {type(fault).__name__}: {fault}"

    def table(self, part: str, unix: float) -> DayTable | None:
        """The table a moment lies in; None where there is none, or none yet."""
        if not _FROM <= unix < _TO:
            return None
        day = int(unix // DAY)
        table = self._tables.get((part, day))
        if self._queue is not None:
            if table is None or (part, day + 1) not in self._tables:
                self._ask(day)
        elif table is None and self._make is not None:
            table = self._work_out(part, day)
        return table if self._in_use else None

    def _ask(self, day: int) -> None:
        """Have the thread work out a day, once."""
        if self._queue is not None and day not in self._asked and len(self._asked) < _DAYS_ASKED:
            self._asked.add(day)
            self._queue.put(day)

    def _work(self, asked: SimpleQueue[int], done: Callable[[], object] | None) -> None:
        """The thread."""
        self.load()
        while not self.failure:
            day = asked.get()
            for part, one in ((part, one) for one in (day, day + 1) for part in PARTS):
                if (part, one) not in self._tables:
                    self._work_out(part, one)
            self._asked.discard(day)
            if done is not None and asked.empty():
                done()
                done = None

    def _work_out(self, part: str, day: int) -> DayTable:
        """Make a table and keep it in the place of the oldest; only one thread ever does this."""
        assert self._make is not None
        table = self._make(part, day)
        if len(self._tables) >= _TABLES_KEPT:
            del self._tables[next(iter(self._tables))]
        self._tables[part, day] = table
        return table
