"""Debian's Chromium in its build without a window, which needs half the processor time of the other.

Tabs are opened through its debugging port, which speaks plain HTTP. It may reach this computer only, keeps nothing,
and asks nobody for anything by itself.
"""

from __future__ import annotations

import http.client
import http.server
import json
import os
import threading
from typing import Any
from urllib.parse import quote

from .processes import PATIENCE, Workshop, requires, wait_until

QUIET = (
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-default-apps",
    "--disable-extensions",
)


class Browser:
    """One running browser. ``names`` are hosts that are this computer."""

    def __init__(self, workshop: Workshop, *names: str) -> None:
        requires("chromium-headless-shell")
        folder = workshop.folder / "chromium"
        here = "".join(f"MAP {name} 127.0.0.1, " for name in names)
        argv = [
            "chromium-headless-shell",
            "--disable-gpu",
            "--disable-dev-shm-usage",
            *QUIET,
            f"--host-resolver-rules={here}MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
            f"--user-data-dir={folder}",
            "--remote-debugging-port=0",
        ]
        if os.geteuid() == 0:
            argv.append("--no-sandbox")  # it refuses to run as root otherwise
        workshop.start([*argv, "about:blank"], {"HOME": str(workshop.folder)})
        told = folder / "DevToolsActivePort"
        wait_until("the browser listens", lambda: told.exists() and "\n" in told.read_text())
        self._port = int(told.read_text().splitlines()[0])

    def _ask(self, method: str, path: str) -> Any:
        link = http.client.HTTPConnection("127.0.0.1", self._port, timeout=PATIENCE)
        try:
            link.request(method, path)
            return json.loads(link.getresponse().read())
        finally:
            link.close()

    def visit(self, url: str) -> str:
        """Open an address in a new tab; the tab's name."""
        return str(self._ask("PUT", f"/json/new?{quote(url, safe=':/?=&')}")["id"])

    def shows(self, tab: str) -> tuple[str, str]:
        """Where a tab has come to: the address, and the title of the page."""
        return next((page["url"], page["title"]) for page in self._ask("GET", "/json/list") if page["id"] == tab)


class Site:
    """Pages of somebody's, served to this computer; what pages ask for is kept in `asked`."""

    def __init__(self, workshop: Workshop, pages: dict[str, str]) -> None:
        self.asked: list[str] = []
        asked = self.asked

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                asked.append(self.path)
                page = pages.get(self.path, "").encode()
                self.send_response(200)
                self.send_header("Content-Type", "text/html")
                self.send_header("Content-Length", str(len(page)))
                self.end_headers()
                self.wfile.write(page)

            def log_message(self, *_: object) -> None:
                """Nothing on standard error."""

        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True).start()
        self._server = server
        workshop.keep(self.close)
        self.url = f"http://127.0.0.1:{server.server_port}"

    def close(self) -> None:
        """It is served no more."""
        self._server.shutdown()
        self._server.server_close()
