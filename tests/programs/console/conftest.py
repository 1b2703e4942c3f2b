"""One gateway and one browser for the tests of the console's page that a process runs in a row; a page for each.

Not longer than that: Playwright keeps an event loop running in the thread, beside which no other can run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType

import pytest
from playwright.sync_api import Browser, sync_playwright

from ..processes import workshop_in
from .page import PHONE, Console, Visit, open_browser


@pytest.fixture(scope="package")
def console(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Console]:
    with workshop_in(tmp_path_factory.mktemp("console")) as shop:
        yield Console(shop)


@pytest.fixture(scope="package")
def browser(console: Console) -> Iterator[Browser]:
    with sync_playwright() as playwright:
        opened = open_browser(playwright.chromium)
        yield opened
        opened.close()


@pytest.fixture
def visit(console: Console, browser: Browser) -> Iterator[Callable[..., Visit]]:
    """Open the page: ``visit()``, or with a size, and with what this browser has kept of earlier visits."""
    opened: list[Visit] = []

    def open_page(size: tuple[int, int] = PHONE, told: Mapping[str, str] = MappingProxyType({}), **kept: str) -> Visit:
        mode = {"light-mode": "day", "light-shown": "day", "rate": "7"}
        opened.append(
            Visit(
                browser,
                console.url,
                size,
                mode | {key.replace("_", "-"): value for key, value in kept.items()},
                told=told,
            )
        )
        return opened[-1]

    yield open_page
    for one in opened:
        one.close()
    with console.program() as program:
        program.say(b":Q#")
    console.at_rest()
