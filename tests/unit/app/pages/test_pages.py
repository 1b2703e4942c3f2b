"""Who may speak to the console: its own page, reached by an address or a name of this computer."""

from __future__ import annotations

import socket

from gateway.app import pages
from gateway.system.own_names import is_own_host
from tests.support.console.browser import node
from tests.support.each import each

NAME = socket.gethostname().lower().partition(".")[0]


@each(
    ("header", "allowed"),
    [
        ("127.0.0.1:4080", True),
        ("127.0.0.1", True),
        ("[::1]:4080", True),
        ("localhost:9999", True),
        ("LOCALHOST", True),
        (NAME, True),
        (f"{NAME}.local:4080", True),
        ("192.0.2.7:4080", True),  # the address at which the connection came in
        ("pier.example.org", True),  # configured
        ("203.0.113.7:8080", True),  # configured: an address that a router or a container translates
        ("[2001:DB8::7]", True),
        ("192.0.2.8:4080", False),
        ("evil.example", False),
        ("localhost.evil.example", False),
        ("127.0.0.1.evil.example", False),
        ("", False),
        (None, False),
        ("[::1", True),
    ],
)
def test_console_accepts_only_host_names_of_this_computer(header: str | None, allowed: bool) -> None:
    assert is_own_host(header, "192.0.2.7", ["Pier.example.org", "203.0.113.7", "2001:db8::7"]) is allowed


@each(
    ("origin", "host", "allowed"),
    [
        (None, "127.0.0.1:4080", True),
        ("http://127.0.0.1:4080", "127.0.0.1:4080", True),
        ("http://127.0.0.1:8080", "127.0.0.1:4080", True),  # a tunnel may have another port
        ("http://evil.example", "127.0.0.1:4080", False),
        ("null", "127.0.0.1:4080", False),
        ("file://", "127.0.0.1:4080", False),
        ("http://127.0.0.1.evil.example", "127.0.0.1", False),
        ("", "127.0.0.1", False),
    ],
)
def test_console_refuses_foreign_origins(origin: str | None, host: str, allowed: bool) -> None:
    assert pages.is_same_origin(origin, host) is allowed


@each(
    ("site", "elsewhere"), [(None, False), ("none", False), ("same-origin", False), ("cross-site", True),
                            ("same-site", True)]
)  # fmt: skip
def test_console_refuses_cross_site_requests_by_fetch_metadata(site: str | None, elsewhere: bool) -> None:
    assert pages.is_from_other_site({} if site is None else {"Sec-Fetch-Site": site}) is elsewhere


def test_console_refuses_a_partial_or_missing_token() -> None:
    assert pages.is_same_token("abc", "abc")
    assert not pages.is_same_token("ab", "abc")
    assert not pages.is_same_token(None, "abc")
    assert not pages.is_same_token("ä", "abc")


def test_page_closed_for_too_many_pages_retries_after_a_minute() -> None:
    """Else it would take the place of the next page, and that one its own."""
    with node() as browser:

        def speaks_after(code: int, seconds: float) -> bool:
            """Whether a page sends beats that long after its connection was closed with this code."""
            browser.ask(code, 0.0, "load")
            browser.ask(code, 100.0, "opened")
            browser.ask(code, 1000.0, "closed", code)
            browser.ask(code, 1000.0 + seconds * 1000.0, "opened")
            return any(browser.ask(code, 2000.0 + seconds * 1000.0, "wait")["sent"])

        assert speaks_after(1006, 5.0)
        assert not speaks_after(1013, 55.0)
        assert speaks_after(1013, 65.0)
