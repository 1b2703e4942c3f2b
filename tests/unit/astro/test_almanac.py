"""The almanac: its file and whom it is trusted from, the process that calculates it, and all that can go wrong."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Collection, Iterator
from pathlib import Path

import pytest

from gateway.app.config import parse_site
from gateway.astro.ephemeris import almanac as file
from gateway.astro.ephemeris import keeper
from gateway.astro.ephemeris.almanac import Almanac, decoded, read
from gateway.astro.ephemeris.day_table import DAY, PARTS
from gateway.astro.ephemeris.keeper import AlmanacKeeper
from gateway.astro.ephemeris.sky import Sky
from gateway.astro.offline import go_offline
from gateway.cli import main
from gateway.core.errors import UserError
from gateway.diagnostics.rehearsal.samples import START
from tests.support.each import each
from tests.support.process import EAGER

TODAY = 20780
WHOLE_DAY = bytes(8 * 333)
REAL = keeper.calculated


def today() -> float:
    """The clock of the gateways that keep an almanac here."""
    return TODAY * DAY + 100.0


def made(days: Collection[int], sites: Collection[str] = (), by: str = "astropy 8.0") -> Almanac:
    """An almanac as quick as it is wrong."""
    return Almanac(by, dict.fromkeys(days, WHOLE_DAY), {site: (48.5, 11.5) for site in sites if site != "x"})


class Process:
    """Stands for the process that calculates: what it was asked, and how it fares."""

    def __init__(self) -> None:
        self.asked: list[tuple[list[int], list[str]]] = []
        self.by, self.fails = "astropy 8.0", ""

    def __call__(self, days: Collection[int], sites: Collection[str]) -> Almanac:
        self.asked.append((list(days), list(sites)))
        if self.fails:
            raise ValueError(self.fails)
        return made(days, sites, self.by)


@pytest.fixture
def process(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Process:
    monkeypatch.setenv("CACHE_DIRECTORY", str(tmp_path / "cache"))
    monkeypatch.setattr(keeper, "calculated", found := Process())
    monkeypatch.setattr(keeper, "ATTEMPTS", 3)
    monkeypatch.setattr(keeper.time, "time", today)
    return found


@pytest.fixture(scope="module")
def exact() -> Almanac:
    go_offline()
    from gateway.astro.ephemeris import by_astropy

    return by_astropy.almanac([TODAY, TODAY + 1])


# --- the file ---------------------------------------------------------------------------------------------------------


@each("part", PARTS)
def test_a_table_of_the_almanac_is_astropys_own(part: str, exact: Almanac) -> None:
    from gateway.astro.ephemeris import by_astropy

    kept = decoded(exact.encoded())
    for day in (TODAY, TODAY + 1):
        table = kept.table(part, day)
        assert table is not None and table.rows == by_astropy.day_table(part, day).rows
    assert kept.table(part, TODAY + 2) is None


def test_every_damage_is_seen() -> None:
    good = made([TODAY], ["a"]).encoded()
    assert decoded(good).days == {TODAY: WHOLE_DAY}
    damaged = [good[:place] + bytes([good[place] ^ 1]) + good[place + 1 :] for place in range(0, len(good), 7)]
    for data in [*damaged, b"", good[:-1], good[:20], b"x" * 5000, Almanac("", {1: b"short"}).encoded()]:
        with pytest.raises(ValueError, match=r"almanac|damaged|whole"):
            decoded(data)


@pytest.mark.skipif(os.name != "posix", reason="Windows has no modes")
def test_a_file_that_another_user_can_write_is_not_trusted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "almanac"
    path.write_bytes(made([TODAY]).encoded())
    for mode, trusted in [(0o600, True), (0o644, True), (0o664, False), (0o602, False)]:
        path.chmod(mode)
        if trusted:
            assert read(path).days
        else:
            with pytest.raises(ValueError, match="other users can write it"):
                read(path)
    path.chmod(0o600)
    if os.getuid():
        monkeypatch.setattr(file, "user", lambda: 4711)
    else:
        os.chown(path, 4711, 4711)
    with pytest.raises(ValueError, match="belongs to another user"):
        read(path)
    copy = tmp_path / "copy"
    monkeypatch.undo()
    copy.write_bytes(path.read_bytes())
    assert read(copy).days, "a copy is this user's own"


def test_the_rehearsals_days_are_in_the_package() -> None:
    """Made by ``mount-gateway almanac - --dates 20481,20482,20483``."""
    go_offline()
    from gateway.astro.ephemeris import by_astropy

    shipped = decoded(file.SHIPPED.read_bytes())
    assert file.SHIPPED.stat().st_size <= 10_000
    assert set(shipped.days) == set(range(int(START // DAY), int(START // DAY) + 3))
    for day in shipped.days:
        for part in PARTS:
            table = shipped.table(part, day)
            assert table is not None
            for row, right in zip(table.rows, by_astropy.day_table(part, day).rows, strict=True):
                assert row == pytest.approx(right, rel=1e-8, abs=1e-8)  # other data on the Earth's rotation


# --- storing ----------------------------------------------------------------------------------------------------------


def test_what_is_stored_is_not_calculated_again(process: Process) -> None:
    almanac, trouble = keeper.renewed(TODAY, [TODAY, TODAY + 1], ["a"])
    assert set(almanac.days) == {TODAY, TODAY + 1} and not trouble
    assert keeper.stored() == almanac == keeper.renewed(TODAY, [TODAY], ["a"])[0]
    keeper.renewed(TODAY, [TODAY, TODAY + 2], ["a", "b"])
    assert process.asked == [([TODAY, TODAY + 1], ["a"]), ([TODAY + 2], ["b"])]
    folder = keeper.cache_directory()
    assert [path.name for path in folder.iterdir()] == ["almanac"]
    if os.name == "posix":
        assert folder.stat().st_mode & 0o777 == 0o700 and (folder / "almanac").stat().st_mode & 0o777 == 0o600


def test_two_that_start_together_on_an_empty_cache_calculate_once(process: Process) -> None:
    begun, go_on, found = threading.Event(), threading.Event(), list[Almanac]()

    def slowly(days: Collection[int], sites: Collection[str]) -> Almanac:
        begun.set()
        assert go_on.wait(20)
        return process(days, sites)

    keeper.calculated = slowly
    threads = [threading.Thread(target=lambda: found.append(keeper.renewed(TODAY, [TODAY])[0])) for _ in range(2)]
    threads[0].start()
    assert begun.wait(20)
    threads[1].start()
    go_on.set()
    for thread in threads:
        thread.join(20)
    assert len(process.asked) == 1 and found[0] == found[1] == keeper.stored()


def test_days_of_another_astropy_or_of_older_data_are_dropped(process: Process) -> None:
    keeper.renewed(TODAY, [TODAY], ["a"])
    process.by = "astropy 9.0"
    almanac, _ = keeper.renewed(TODAY, [TODAY + 1])
    assert (almanac.by, set(almanac.days), set(almanac.sites)) == ("astropy 9.0", {TODAY + 1}, {"a"})


def test_old_days_make_room_and_those_asked_for_last_stay(process: Process) -> None:
    keeper.renewed(TODAY, [TODAY - 2, TODAY - 1, TODAY])
    for day in range(100):
        keeper.renewed(TODAY, [day], [str(day)])
    kept = keeper.stored()
    assert {TODAY - 1, TODAY} < set(kept.days) and TODAY - 2 not in kept.days and 99 in kept.days
    assert len(kept.days) == keeper.STORED + 2 and len(kept.sites) == keeper.STORED


def _no_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder.parent.joinpath("cache").write_text("a file")


def _read_only(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a read-only file system: a mode does not keep root from writing."""

    def refuse(path: object, *rest: object, **others: object) -> int:
        raise OSError(30, "Read-only file system")

    folder.mkdir(mode=0o700)
    monkeypatch.setattr("gateway.system.locks.os.open", refuse)


def _full(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(path: Path, data: bytes) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(keeper, "replace_file", full)


def _homeless(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CACHE_DIRECTORY", "~/.cache")


def _open_to_others(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder.mkdir()
    folder.chmod(0o777)


@pytest.mark.parametrize(
    ("spoil", "says"),
    [(_no_folder, "File exists"), (_read_only, "Read-only file system"), (_full, "No space left"),
     (_homeless, "no home folder"), (_open_to_others, "other users can write there")],
)  # fmt: skip
def test_what_cannot_be_stored_is_used_all_the_same_and_told_once(
    spoil: Callable[[Path, pytest.MonkeyPatch], None], says: str, process: Process, tmp_path: Path
) -> None:
    with pytest.MonkeyPatch.context() as patch:
        spoil(tmp_path / "cache", patch)
        sky, told = Sky(), list[str]()
        kept = AlmanacKeeper(sky, told.append, clock=today)
        kept.open()
        for days in ([TODAY], [TODAY + 1]):
            asyncio.run(kept._renew(days))
        assert sky.ready and sky.source((TODAY + 1.5) * DAY).startswith("almanac of")
        assert sky.source(TODAY * DAY).startswith("almanac of"), "what was calculated before is kept in memory"
        assert len(told) == 1 and says in told[0] and "cannot be stored" in told[0]


# --- the process ------------------------------------------------------------------------------------------------------


@pytest.fixture
def calculates(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Let this program be the process that calculates."""

    def be(program: str) -> None:
        monkeypatch.setattr(keeper, "gateway_argv", lambda: [sys.executable, "-c", program])

    monkeypatch.setattr(keeper, "LONGEST", 20.0)
    return be


def test_the_process_calculates_days_and_sites_and_leaves_nothing_here(
    exact: Almanac, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(keeper, "gateway_argv", lambda: EAGER)
    almanac = REAL([TODAY, TODAY + 1], ["48°30'N,11°30'E", "north,x", "1"])
    assert almanac == Almanac(exact.by, exact.days, {"48°30'N,11°30'E": (48.5, 11.5)})


@each(
    ("program", "says"),
    [("import nothing_like_this", "No module named 'nothing_like_this'"), ("raise SystemExit(3)", "it ended with 3"),
     ("print('hello')", "no almanac of this version"), ("import os; os.kill(os.getpid(), 9)", "it ended with -9")],
)  # fmt: skip
def test_a_process_that_dies_says_why(program: str, says: str, calculates: Callable[[str], None]) -> None:
    calculates(program)
    with pytest.raises(ValueError, match=says):
        REAL([TODAY], [])


def test_the_process_ends_with_the_gateway_that_started_it() -> None:
    words = [*keeper.gateway_argv(), "almanac", "-", "--dates", ",".join(map(str, range(TODAY, TODAY + 1000)))]
    left = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, timeout=60.0)  # nobody holds its input
    assert (left.returncode, left.stdout) == (1, b"")


@pytest.mark.skipif(os.name != "posix", reason="Windows has no SIGKILL")
def test_a_process_that_hangs_is_killed(
    calculates: Callable[[str], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calculates(f"import os, time; open({str(tmp_path / 'pid')!r}, 'w').write(str(os.getpid())); time.sleep(60)")
    monkeypatch.setattr(keeper, "LONGEST", 2.0)
    with pytest.raises(ValueError, match="more than 2 s"):
        REAL([TODAY], [])
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), signal.SIGCONT)


# --- when it is calculated --------------------------------------------------------------------------------------------


@pytest.fixture
def clock(process: Process, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[float]]:
    """The time, in seconds, as it passes: monotonic."""
    now = [1000.0]
    monkeypatch.setattr(keeper.time, "monotonic", lambda: now[0])
    return now


def wanted(days: int, quiet: bool = True, today: float = TODAY, missing: Collection[int] = ()) -> list[int]:
    """What is calculated when tables of so many days from today on are left."""
    sky = Sky()
    kept = AlmanacKeeper(sky, print, quiet=lambda: quiet, clock=lambda: today * DAY + 1.0)
    kept._use(made(range(int(today), int(today) + days)))
    sky.missing.update(missing)
    return kept._wanted()


def test_the_next_days_are_calculated_when_few_are_left_and_nothing_moves() -> None:
    assert wanted(0) == wanted(0, quiet=False) == [*range(TODAY, TODAY + 40)]
    assert wanted(10) == wanted(40) == wanted(9, quiet=False) == []
    assert wanted(9) == [*range(TODAY + 9, TODAY + 40)]


def test_another_date_is_calculated_at_once_with_the_days_after_it() -> None:
    assert wanted(40, quiet=False, missing=[15000]) == [*range(15000, 15004)]


def test_a_clock_of_1970_asks_for_its_own_days_and_later_for_todays() -> None:
    assert wanted(0, today=0.0) == [*range(40)]
    assert wanted(40, today=0.0, missing=[TODAY]) == [*range(TODAY, TODAY + 4)]


@each("year", [1899, 2101])
def test_a_clock_in_a_year_without_tables_asks_for_nothing(year: int) -> None:
    assert wanted(0, today=int((year - 1970) * 365.2425)) == []


def test_at_the_end_of_the_last_year_only_its_days_are_asked_for() -> None:
    assert wanted(0, today=47480) == [*range(47480, 47482)]


def test_what_fails_is_tried_again_after_an_hour_three_times_a_day_and_told_once(
    process: Process, clock: list[float]
) -> None:
    process.fails, told = "No module named 'astropy'", list[str]()
    kept = AlmanacKeeper(Sky(), told.append, clock=today)
    tried = []
    for minute in range(3 * 24 * 60):
        clock[0] = 1000.0 + 60.0 * minute
        if kept._may_try():
            tried.append(minute)
            asyncio.run(kept._renew([TODAY]))
    assert tried == [start + hour for start in (0, 1440, 2880) for hour in (0, 60, 120)]
    assert len(told) == 1 and "No module named 'astropy'" in told[0] and "an hour" in told[0]


def test_other_dates_are_calculated_six_times_an_hour_and_that_is_told_once(
    process: Process, clock: list[float]
) -> None:
    sky, told = Sky(), list[str]()
    kept = AlmanacKeeper(sky, told.append, clock=today)
    kept._use(made(range(TODAY, TODAY + 40)))

    for number in range(9):  # a program sets one date after another
        sky.sun((15000 + 10 * number) * DAY)
        if days := kept._wanted():
            asyncio.run(kept._renew(days))
    assert len(process.asked) == 6 and sky.source(15090 * DAY) == "closed form"
    assert len(told) == 1 and "6 other dates within an hour" in told[0]
    kept._use(Almanac())
    assert kept._wanted() == [*range(TODAY, TODAY + 40)], "what is needed today is calculated all the same"
    kept._use(made(range(TODAY, TODAY + 40)))
    clock[0] += 3600.0
    assert len(kept._wanted()) == 4 * keeper.OTHERS, "those that were left"
    assert len(told) == 1


def test_a_keeper_without_room_for_a_thread_says_so_and_goes_on(
    process: Process, clock: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(thread: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    told = list[str]()
    kept = AlmanacKeeper(Sky(), told.append, clock=today)
    with monkeypatch.context() as patch:
        patch.setattr(threading.Thread, "start", refuse)
        asyncio.run(kept._renew([TODAY]))
    assert len(told) == 1 and "can't start new thread" in told[0] and not kept._may_try()
    clock[0] += 3600.0
    asyncio.run(kept._renew([TODAY]))
    assert TODAY in kept._almanac.days


def test_it_is_exact_as_soon_as_it_can_be_and_that_is_told_once(process: Process) -> None:
    async def program() -> tuple[list[int], list[int]]:
        sky, exact, entered = Sky(), list[int](), list[int]()

        def enter(act: Callable[[], object]) -> None:
            entered.append(1)
            act()

        kept = AlmanacKeeper(sky, print, lambda: exact.append(1), enter=enter, clock=today)
        kept.open()
        assert not exact
        keeping = asyncio.ensure_future(kept.keep())
        end = time.perf_counter() + 20.0
        while not exact and time.perf_counter() < end:
            await asyncio.sleep(0.01)
        assert sky.source(TODAY * DAY).startswith("almanac of") and len(process.asked) == 1
        assert sky.sun(15000 * DAY) and sky.missing == {15000}  # asks for another date
        while sky.missing and time.perf_counter() < end:
            await asyncio.sleep(0.01)
        keeping.cancel()
        return exact, entered

    assert asyncio.run(program()) == ([1], [1, 1])
    assert [days[0] for days, _ in process.asked] == [TODAY, 15000]
    sky, ready = Sky(), list[int]()
    AlmanacKeeper(sky, print, lambda: ready.append(1), clock=today).open()  # the next start
    assert ready and sky.ready


def test_a_program_that_sets_one_date_after_another_fills_no_memory(process: Process) -> None:
    kept = AlmanacKeeper(Sky(), print, clock=today)
    for day in range(200):
        asyncio.run(kept._renew([day]))
    assert len(kept._almanac.days) == keeper.STORED and 199 in kept._almanac.days


def test_the_days_kept_are_those_about_the_keepers_own_today(process: Process) -> None:
    kept = AlmanacKeeper(Sky(), print, clock=lambda: 15000 * DAY)
    asyncio.run(kept._renew([*range(15000, 15040)]))
    assert len(kept._almanac.days) == len(keeper.stored().days) == 40 > keeper.STORED


# --- from another computer --------------------------------------------------------------------------------------------


def test_an_almanac_may_come_from_another_computer(
    process: Process, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "year.almanac"
    assert main(["almanac", str(path), "--days", "2"]) == 0
    assert capsys.readouterr().out.startswith(f"wrote {path}: 2 days, ")
    process.fails, sky, ready = "No module named 'astropy'", Sky(), list[int]()
    AlmanacKeeper(sky, print, lambda: ready.append(1), clock=today).open(str(path))
    assert ready and sky.source(TODAY * DAY).startswith("almanac of") and not process.asked
    assert main(["almanac", str(path), "--days", "0"]) == 2
    assert main(["almanac", str(tmp_path / "nowhere" / "file"), "--days", "1"]) == 2
    monkeypatch.setitem(sys.modules, "gateway.astro.ephemeris.by_astropy", None)
    monkeypatch.delattr("gateway.astro.ephemeris.by_astropy")
    assert main(["almanac", str(path)]) == 2
    assert "astropy cannot be used here" in capsys.readouterr().err


def test_a_named_almanac_that_cannot_be_used_ends_the_start(process: Process, tmp_path: Path) -> None:
    path = tmp_path / "year.almanac"
    with pytest.raises(UserError, match=f"--almanac {path}: No such file"):
        AlmanacKeeper(Sky(), print, clock=today).open(str(path))
    path.write_bytes(b"something else")
    path.chmod(0o600)
    with pytest.raises(UserError, match=f"--almanac {path}: it is no almanac of this version"):
        AlmanacKeeper(Sky(), print, clock=today).open(str(path))


# --- sites ------------------------------------------------------------------------------------------------------------


def test_a_site_is_translated_once(process: Process) -> None:
    for _ in range(2):
        assert parse_site("11°30'E,48°30'N") == (48.5, 11.5)
    assert [sites for _, sites in process.asked] == [["48°30'N,11°30'E"]]
    assert TODAY in process.asked[0][0], "the start that follows is exact"


def test_where_nothing_can_translate_it_the_start_ends_with_how_to_write_it(process: Process) -> None:
    process.fails = "No module named 'astropy'"
    with pytest.raises(UserError) as caught:
        parse_site("48°30'N,11°30'E")
    assert "No module named 'astropy'" in str(caught.value) and "45.5,-122.7 is 45°30'N" in str(caught.value)
    assert "\n" not in str(caught.value)
