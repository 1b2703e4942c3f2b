"""One gateway and one browser for the tests of the console's page that a process runs in a row; a page for each.

Not longer than that: Playwright keeps an event loop running in the thread, beside which no other can run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

from ..processes import workshop_in
from .page import PHONE, Console, Visit, has_touch, new_page, open_browser


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


@pytest.fixture(scope="package")
def unused_pages() -> dict[bool, list[Page]]:
    """Pages of ended visits, with a touch screen (true) or without; a new page takes half a second of processor."""
    return {True: [], False: []}


@pytest.fixture
def visit(console: Console, browser: Browser, unused_pages: dict[bool, list[Page]]) -> Iterator[Callable[..., Visit]]:
    """Open the page: ``visit()``, or with a size, and with what this browser has kept of earlier visits.

    ``fresh``: in a browser that has nothing cached; also for scripts that are to run before the page's, and so would
    in later visits.
    """
    opened: list[tuple[Visit, list[Page] | None]] = []

    def open_page(
        size: tuple[int, int] = PHONE,
        told: Mapping[str, str] = MappingProxyType({}),
        *,
        fresh: bool = False,
        **kept: str,
    ) -> Visit:
        kept = {"light-mode": "day", "light-shown": "day", "rate": "7"} | {
            key.replace("_", "-"): value for key, value in kept.items()
        }
        unused = None if fresh or told else unused_pages[has_touch(size)]
        page = unused.pop() if unused else new_page(browser, size)
        opened.append((Visit(page, console.url, size, kept, told=told), unused))
        return opened[-1][0]

    yield open_page
    try:
        for one, unused in opened:
            if unused is None:
                one.close()
            else:
                one.leave()
                unused.append(one.page)
    finally:  # also if a page complained: the next test begins at rest
        with console.program() as program:
            program.say(b":Q#")
        console.at_rest()
