"""Whose clock is doubted: a board without a clock battery that nothing has set. Files stand for the board."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from gateway.core.about import EARLIEST_VALID_TIME
from gateway.mount.site.site_clock import SiteClock
from gateway.system import computer_clock
from gateway.system.computer_clock import ClockCheck, is_clock_synchronised, lacks_hardware_clock
from tests.support.each import each
from tests.support.in_process_gateway import Bridge

TREE, FIRMWARE = "proc/device-tree/model", "sys/firmware/devicetree/base/model"


@each(
    ("files", "without"),
    [((), False), ((TREE,), True), ((FIRMWARE,), True), ((TREE, "dev/rtc0"), False), (("dev/rtc",), False)],
)
def test_board_without_a_hardware_clock_is_recognised(files: tuple[str, ...], without: bool, tmp_path: Path) -> None:
    tmp_path /= f"{len(files)}{without}{files}".replace("/", "-")
    for name in files:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("Raspberry Pi 4 Model B")
    tmp_path.mkdir(exist_ok=True)
    assert lacks_hardware_clock(tmp_path) is without


def test_unreadable_device_tree_does_not_count_as_lack_of_a_hardware_clock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever may read everything (root) is refused here by a stand-in, as the system refuses others."""

    def refused(path: object, **_: object) -> None:
        raise PermissionError(13, "Permission denied", path)

    monkeypatch.setattr(os, "stat", refused)
    assert not lacks_hardware_clock(tmp_path)


@pytest.mark.skipif(sys.platform != "linux", reason="other kernels do not tell")
def test_computer_time_is_doubted_on_a_board_until_the_kernel_reports_it_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = [False, True]
    monkeypatch.setattr(computer_clock, "is_clock_synchronised", lambda: said.pop(0))
    assert not ClockCheck(tmp_path)()
    (tmp_path / "proc/device-tree").mkdir(parents=True)
    (tmp_path / TREE).touch()
    board = ClockCheck(tmp_path)
    assert board()
    assert board(), "the kernel is asked once a minute"
    monkeypatch.setattr(computer_clock, "_CHECK_PERIOD", -1.0)
    assert not board()


def test_kernel_query_for_clock_sync_gives_true_or_false() -> None:
    assert is_clock_synchronised() in (True, False)


@each(
    ("choice", "now", "kernel", "doubtful"),
    [
        ("auto", EARLIEST_VALID_TIME + 1.0, False, False),
        ("auto", EARLIEST_VALID_TIME + 1.0, True, True),
        ("auto", EARLIEST_VALID_TIME - 1.0, False, True),
        ("right", 0.0, True, False),
        ("doubtful", EARLIEST_VALID_TIME + 1.0, False, True),
    ],
)
def test_computer_clock_setting_overrides_date_and_kernel_state(
    choice: str, now: float, kernel: bool, doubtful: bool
) -> None:
    assert SiteClock(lambda: 0.0, lambda: now, None, choice, lambda: kernel).doubts_computer_time(now) is doubtful


async def test_computer_clock_setting_decides_if_time_is_doubted() -> None:
    for choice, doubtful in (("auto", False), ("right", False), ("doubtful", True)):
        async with Bridge("cge", config={"computer_clock": choice}) as bridge:
            assert bridge.site_clock.doubts_computer_time(bridge.pc_time()) is doubtful
