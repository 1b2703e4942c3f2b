"""The console's sky chart in Chromium: fingers, wheel and keys, the red of the night, and nothing drawn in vain.

A page of the test's own uses the chart and posts what it saw; nothing of it is served by the product.
"""

from __future__ import annotations

import http.server
import json
import threading
from pathlib import Path
from typing import Any

import pytest

from .browser import Browser
from .processes import Workshop, requires, wait_until

PAGE = Path(__file__).resolve().parents[2] / "gateway/console/page"
PAGES = Path(__file__).with_name("pages")
TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".json": "application/json"}


class Served:
    """The product's page under /page/, the test's under /test/; ``told`` is what the page has posted."""

    def __init__(self, workshop: Workshop) -> None:
        self.told: list[dict[str, Any]] = []
        told = self.told

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                _, folder, *rest = self.path.partition("?")[0].split("/", 2)
                path = {"page": PAGE, "test": PAGES}.get(folder, PAGES).joinpath(*rest)
                body = path.read_bytes() if path.is_file() else b""
                self.send_response(200 if body else 404)
                self.send_header("Content-Type", TYPES.get(path.suffix, "text/plain"))
                self.send_header("Content-Length", str(len(body)))
                self.end_headers()
                self.wfile.write(body)

            def do_POST(self) -> None:
                told.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
                self.send_response(204)
                self.end_headers()

            def log_message(self, *_: object) -> None:
                """Nothing on standard error."""

        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True).start()
        workshop.keep(server.server_close)
        workshop.keep(server.shutdown)
        self.url = f"http://127.0.0.1:{server.server_port}/test/chart.html"


def test_sky_chart_obeys_fingers_wheel_and_keys_without_redundant_drawing(workshop: Workshop) -> None:
    requires("chromium-headless-shell")
    served, browser = Served(workshop), Browser(workshop)
    browser.visit(served.url)
    wait_until("the page has used the chart", lambda: bool(served.told))
    [seen] = served.told
    assert seen["errors"] == []
    role, tab, label = seen["role"]
    assert (role, tab) == ("application", 0) and "It points to altitude 52°" in label and "Moon" in label
    assert seen["size"] == [390, 600]
    # fingers
    vega, saturn, free = seen["picked"]
    assert (vega["name"], vega["ra2000"], vega["dec2000"]) == ("Vega", 279.2347, 38.7837)
    assert saturn["name"] == "Saturn" and vega["alt"] > 0
    assert free["name"] == "Sadr" or (free["ra2000"], free["dec2000"]) == pytest.approx((300.0, 40.0), abs=3.0)
    assert seen["outside"] == 0
    assert seen["underTheWheel"] == seen["underTheDrag"] == seen["afterDoubleTap"] == ["Vega"]
    assert seen["draggedPicks"] == 0
    assert seen["pinched"] == [False]
    # keys
    assert all(key == {"prevented": True, "reached": False} for key in seen["keys"])
    assert all(key == {"prevented": False, "reached": True} for key in seen["left"])
    assert seen["keyPicks"] == 1 and len(seen["said"]) == 2 and "altitude" in seen["said"][0]
    # colours
    assert seen["day"]["kinds"] > 100 and seen["day"]["wrong"] > 10_000
    for night in (seen["night"], seen["nightEnlarged"]):
        assert night["wrong"] == 0 and night["reddest"] > 200 and night["kinds"] > 30
    # work
    print(f"a frame takes {seen['quick']:.2f} ms")
    assert seen["quick"] < 20.0, "one of ten; a loaded computer delays the others"
    assert seen["idleFrames"] == 0
    assert seen["changedFrames"] == [1, 1, 1]
