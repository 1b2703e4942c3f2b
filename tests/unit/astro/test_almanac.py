"""The almanac: its file and whom it is trusted from, the process that calculates it, and all that can go wrong."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Collection
from pathlib import Path

import pytest

from gateway.astro.ephemeris import almanac as file
from gateway.astro.ephemeris import keeper
from gateway.astro.ephemeris.almanac import DAY, MAX_DAYS, SKY_PARTS, Almanac, decode, load_stored, read
from gateway.astro.ephemeris.keeper import CHECK_PERIOD, MIN_DAYS_LEFT, RETRY_PERIOD, AlmanacKeeper, renew_almanac
from gateway.astro.ephemeris.sky import Sky
from gateway.astro.offline import go_offline
from gateway.cli import main
from gateway.core.errors import UserError
from gateway.diagnostics.rehearsal.samples import START_TIME
from gateway.diagnostics.virtual_time import run
from gateway.system.locks import PidLock
from tests.support.each import each
from tests.support.process import EAGER

TODAY, AHEAD = 20780, 30
WHOLE_DAY = bytes(8 * 333)
REAL = keeper.calculate_in_process


def made(days: Collection[int]) -> Almanac:
    """An almanac as quick as it is wrong."""
    return Almanac(dict.fromkeys(days, WHOLE_DAY))


class Process:
    """Stands for the process that calculates: what it was asked, and how it fares."""

    def __init__(self) -> None:
        self.asked: list[list[int]] = []
        self.fails = ""

    def __call__(self, days: Collection[int]) -> Almanac:
        self.asked.append(list(days))
        if self.fails:
            raise ValueError(self.fails)
        return made(days)


@pytest.fixture
def process(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Process:
    monkeypatch.setenv("CACHE_DIRECTORY", str(tmp_path / "cache"))
    monkeypatch.setattr(keeper, "calculate_in_process", found := Process())
    monkeypatch.setattr(keeper, "DAYS_PER_CALCULATION", AHEAD)
    return found


class Serving:
    """A process that serves mounts: its sky, its clock in days, whether nothing moves, and what it has told."""

    def __init__(self, today: float = TODAY) -> None:
        self.sky, self.today, self.quiet = Sky(), today, True
        self.told = list[str]()
        self.later: list[Callable[[], object]] = []

    def runs(self, seconds: float, start: Callable[[threading.Thread], object] = threading.Thread.run) -> None:
        """Serve for some seconds of virtual time, in which threads take none; ``later`` is done a second apart."""

        async def program() -> None:
            kept = AlmanacKeeper(self.sky, self.told.append, lambda: self.quiet, lambda: self.today * DAY + 100.0)
            kept.open()
            keeping = asyncio.ensure_future(kept.run())
            for act in self.later:
                await asyncio.sleep(1.0)
                act()
            await asyncio.sleep(seconds)
            keeping.cancel()

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(threading.Thread, "start", start)
            run(program())

    def has(self, day: int) -> bool:
        return self.sky.calculation_source((day + 0.5) * DAY).startswith("almanac of")


@pytest.fixture(scope="module")
def exact() -> Almanac:
    go_offline()
    from gateway.astro.ephemeris import by_astropy

    return by_astropy.calculate_almanac([TODAY, TODAY + 1])


# --- the file ---------------------------------------------------------------------------------------------------------


@each("part", SKY_PARTS)
def test_almanac_file_keeps_every_value_of_every_day(part: str, exact: Almanac) -> None:
    kept = decode(exact.encode())
    for moment in (TODAY * DAY, (TODAY + 1.3) * DAY, (TODAY + 2) * DAY - 1.0):
        assert kept.values_at(part, moment) == exact.values_at(part, moment) is not None
    assert kept.values_at(part, (TODAY + 2) * DAY) is None


def test_damaged_almanac_file_is_detected() -> None:
    good = made([TODAY]).encode()
    assert decode(good).days == {TODAY: WHOLE_DAY}
    damaged = [good[:place] + bytes([good[place] ^ 1]) + good[place + 1 :] for place in range(0, len(good), 7)]
    for data in [*damaged, b"", good[:-1], good[:20], b"x" * 5000, Almanac({1: b"short"}).encode()]:
        with pytest.raises(ValueError, match=r"almanac|damaged|incomplete"):
            decode(data)


@pytest.mark.skipif(os.name != "posix", reason="Windows has no modes")
def test_almanac_file_writable_by_another_user_is_not_trusted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "almanac"
    path.write_bytes(made([TODAY]).encode())
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


def test_package_contains_the_almanac_days_that_the_tests_use() -> None:
    """Made by ``mount-gateway almanac - --dates 20481,20482,20483``."""
    go_offline()
    from gateway.astro.ephemeris import by_astropy

    shipped = decode(file.SHIPPED_FILE.read_bytes())
    assert file.SHIPPED_FILE.stat().st_size <= 10_000
    assert set(shipped.days) == set(range(int(START_TIME // DAY), int(START_TIME // DAY) + 3))
    for day in shipped.days:
        for part in SKY_PARTS:  # other data on the Earth's rotation
            row = shipped.values_at(part, (day + 0.4) * DAY)
            now = by_astropy.calculate_almanac([day]).values_at(part, (day + 0.4) * DAY)
            assert row == pytest.approx(now, rel=1e-8, abs=1e-8)


# --- storing ----------------------------------------------------------------------------------------------------------


def test_stored_almanac_is_not_calculated_again(process: Process, tmp_path: Path) -> None:
    almanac, trouble = renew_almanac([TODAY, TODAY + 1])
    assert set(almanac.days) == {TODAY, TODAY + 1} and not trouble
    assert load_stored() == almanac == renew_almanac([TODAY])[0]
    renew_almanac([TODAY, TODAY + 2])
    assert process.asked == [[TODAY, TODAY + 1], [TODAY + 2]]
    folder = tmp_path / "cache"
    assert [path.name for path in folder.iterdir()] == ["almanac"]
    if os.name == "posix":
        assert folder.stat().st_mode & 0o777 == 0o700 and (folder / "almanac").stat().st_mode & 0o777 == 0o600


def test_two_gateways_that_start_together_both_get_the_almanac(process: Process, tmp_path: Path) -> None:
    """While one of them stores it, the other one keeps it in memory."""
    (folder := tmp_path / "cache").mkdir(mode=0o700)
    other = PidLock(folder / "almanac.lock", remove=True)
    other.acquire()
    almanac, trouble = renew_almanac([TODAY])
    assert set(almanac.days) == {TODAY} and not trouble and not load_stored().days
    other.release()
    renew_almanac([TODAY])
    assert set(load_stored().days) == {TODAY}


def test_damaged_almanac_is_calculated_again(process: Process, tmp_path: Path) -> None:
    renew_almanac([TODAY])
    path = tmp_path / "cache" / "almanac"
    path.write_bytes(path.read_bytes()[:-1])
    Serving().runs(60)
    assert TODAY in load_stored().days and len(process.asked) == 2


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


@pytest.mark.parametrize(
    ("spoil", "says"),
    [(_no_folder, "File exists"), (_read_only, "Read-only file system"), (_full, "No space left"),
     (_homeless, "no home folder")],
)  # fmt: skip
def test_almanac_that_cannot_be_stored_is_used_and_reported_once(
    spoil: Callable[[Path, pytest.MonkeyPatch], None], says: str, process: Process, tmp_path: Path
) -> None:
    with pytest.MonkeyPatch.context() as patch:
        spoil(tmp_path / "cache", patch)
        serving = Serving()
        serving.later = [lambda: serving.sky.sun(15000 * DAY)]  # a program sets another date
        serving.runs(3 * CHECK_PERIOD)
    assert serving.has(TODAY) and serving.has(15000), "the first one is kept in memory"
    assert len(serving.told) == 1 and says in serving.told[0] and "cannot be stored" in serving.told[0]
    assert len(process.asked) == 2


# --- the process ------------------------------------------------------------------------------------------------------


@pytest.fixture
def calculates(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Let this program be the process that calculates."""

    def be(program: str) -> None:
        monkeypatch.setattr(keeper, "gateway_argv", lambda: [sys.executable, "-c", program])

    monkeypatch.setattr(keeper, "TIMEOUT", 20.0)
    return be


def test_almanac_process_calculates_days_and_loads_nothing_into_the_gateway(
    exact: Almanac, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(keeper, "gateway_argv", lambda: EAGER)
    almanac = REAL([TODAY, TODAY + 1])
    assert almanac == Almanac(exact.days)


@each(
    ("program", "says"),
    [("import nothing_like_this", "No module named 'nothing_like_this'"), ("raise SystemExit(3)", "it ended with 3"),
     ("print('hello')", "not an almanac of this version"), ("import os; os.kill(os.getpid(), 9)", "it ended with -9")],
)  # fmt: skip
def test_almanac_process_that_dies_reports_why(program: str, says: str, calculates: Callable[[str], None]) -> None:
    calculates(program)
    with pytest.raises(ValueError, match=says):
        REAL([TODAY])


def test_almanac_process_ends_with_its_gateway() -> None:
    words = [*keeper.gateway_argv(), "almanac", "-", "--dates", ",".join(map(str, range(TODAY, TODAY + 1000)))]
    left = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, timeout=60.0)  # nobody holds its input
    assert (left.returncode, left.stdout) == (1, b"")


@pytest.mark.skipif(os.name != "posix", reason="Windows has no SIGKILL")
def test_hanging_almanac_process_is_killed(
    calculates: Callable[[str], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calculates(f"import os, time; open({str(tmp_path / 'pid')!r}, 'w').write(str(os.getpid())); time.sleep(60)")
    monkeypatch.setattr(keeper, "TIMEOUT", 2.0)
    with pytest.raises(ValueError, match="more than 2 s"):
        REAL([TODAY])
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), signal.SIGCONT)


# --- when it is calculated --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("left", "quiet", "first"),
    [(0, False, TODAY), (MIN_DAYS_LEFT, True, TODAY + MIN_DAYS_LEFT), (MIN_DAYS_LEFT, False, None),
     (MIN_DAYS_LEFT + 1, True, None)],
)  # fmt: skip
def test_next_almanac_days_are_calculated_when_few_are_left_and_nothing_moves(
    left: int, quiet: bool, first: int | None, process: Process
) -> None:
    if left:
        renew_almanac(range(TODAY, TODAY + left))
    serving = Serving()
    serving.quiet = quiet
    before = len(process.asked)
    serving.runs(3 * CHECK_PERIOD)
    asked = process.asked[before:]
    assert asked == ([] if first is None else [[*range(first, first + AHEAD)]])
    assert serving.has(TODAY)


def test_almanac_of_another_date_is_calculated_at_once_and_of_the_next_a_minute_later(process: Process) -> None:
    renew_almanac(range(TODAY, TODAY + AHEAD))
    serving = Serving()
    serving.quiet = False
    serving.later = [lambda day=day: serving.sky.sun(day * DAY) for day in range(15000, 15500, 100)]
    serving.runs(CHECK_PERIOD - 10.0)
    assert process.asked[1:] == [[*range(15000, 15000 + AHEAD)]]
    assert serving.has(15000) and not serving.has(15400)
    serving.later = []
    serving.runs(CHECK_PERIOD)
    assert [days[0] for days in process.asked[2:]] == [15400], "which is still missing"


@pytest.mark.parametrize("first", [0.0, 47600.0])
def test_almanac_is_not_calculated_for_a_clock_in_a_year_without_tables(first: float, process: Process) -> None:
    serving = Serving(first)
    serving.later = [lambda: setattr(serving, "today", TODAY)]
    serving.runs(0.0)
    assert not process.asked
    serving.runs(2 * CHECK_PERIOD)
    assert serving.has(TODAY)


def test_almanac_requests_only_days_before_the_end_of_the_tables(process: Process) -> None:
    Serving(47480).runs(CHECK_PERIOD)
    assert process.asked == [[47480, 47481]]


def _no_thread(thread: threading.Thread) -> None:
    raise RuntimeError("can't start new thread")


@pytest.mark.parametrize(
    ("start", "says"), [(threading.Thread.run, "No module named 'astropy'"), (_no_thread, "can't start new thread")]
)
def test_failed_almanac_is_retried_after_an_hour_and_reported_once(
    start: Callable[[threading.Thread], object], says: str, process: Process
) -> None:
    process.fails, serving = "No module named 'astropy'", Serving()
    serving.runs(3.5 * RETRY_PERIOD, start)
    assert len(process.asked) == (4 if start is threading.Thread.run else 0)
    assert len(serving.told) == 1 and says in serving.told[0] and "an hour" in serving.told[0]
    process.fails = ""
    serving.runs(1.0)
    assert serving.has(TODAY)


def test_number_of_stored_almanac_days_is_limited_for_many_dates(process: Process) -> None:
    serving = Serving()
    for day in range(2000, 22000, 500):
        serving.sky.sun(day * DAY)
        serving.runs(1.0)
    assert len(load_stored().days) == MAX_DAYS and 21500 in load_stored().days


# --- from another computer --------------------------------------------------------------------------------------------


def test_almanac_file_made_by_the_command_is_used_at_start(
    process: Process, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "year.almanac"
    monkeypatch.setattr("time.time", lambda: TODAY * DAY)
    assert main(["almanac", str(path), "--days", "2"]) == 0
    assert capsys.readouterr().out.startswith(f"wrote {path}: 2 days, ")
    sky = Sky()
    AlmanacKeeper(sky, print, clock=lambda: TODAY * DAY).open(str(path))
    assert sky.calculation_source(TODAY * DAY).startswith("almanac of") and not process.asked
    assert main(["almanac", str(path), "--days", "0"]) == 2
    assert main(["almanac", str(tmp_path / "nowhere" / "file"), "--days", "1"]) == 2
    monkeypatch.setitem(sys.modules, "gateway.astro.ephemeris.by_astropy", None)
    monkeypatch.delattr("gateway.astro.ephemeris.by_astropy")
    assert main(["almanac", str(path)]) == 2
    assert "astropy cannot be used here" in capsys.readouterr().err


@each(("content", "says"), [(None, "No such file"), (b"something else", "it is not an almanac of this version")])
def test_gateway_start_fails_with_an_unusable_almanac_file(
    content: bytes | None, says: str, process: Process, tmp_path: Path
) -> None:
    path = tmp_path / "year.almanac"
    if content is not None:
        path.write_bytes(content)
        path.chmod(0o600)
    with pytest.raises(UserError, match=f"--almanac {path}: {says}"):
        AlmanacKeeper(Sky(), print).open(str(path))
