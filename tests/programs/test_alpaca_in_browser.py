"""A web page gives no order by Alpaca: Chromium on a foreign page, and on one whose name has become this computer's.

A program with the ClientID that the pages use is connected, so that nothing but the gate stands between them and the
mount. Judged at the simulated mount's line, where nothing but the gateway's own questions may pass.
"""

from __future__ import annotations

import http.client
import json

from .browser import Browser, Site
from .hand_control import HandControl
from .processes import PATIENCE, Workshop, requires, wait_until
from .product import OF_ANOTHER_NIGHT, PRODUCT, endpoints, start_simulator
from .sky import NORTH
from .tap import Tap
from .test_browser import QUESTIONS

API = "/api/v1/telescope/0/"
NAME = "rebound.example"
ORDERS = [
    ("moveaxis", "Axis=0&Rate=2"),
    ("slewtocoordinatesasync", "RightAscension=4&Declination=40"),
    ("tracking", "Tracking=false"),
    ("park", ""),
]
WHO = "ClientID=7&ClientTransactionID=1"
#: All that a page can try of each order: what a browser asks leave for, what it sends at once, an image.
FOREIGN = """<script>
const where = %s, orders = %s;
const tries = where.flatMap(base => orders.flatMap(([member, values]) => {
  const url = base + '%s' + member, body = values + '&%s';
  const text = {'Content-Type': 'text/plain'}, form = {'Content-Type': 'application/x-www-form-urlencoded'};
  new Image().src = url + '?' + body;
  return [
    fetch(url, {method: 'PUT', headers: form, body}),
    fetch(url, {method: 'POST', mode: 'no-cors', headers: form, body}),
    fetch(url, {method: 'POST', mode: 'no-cors', headers: text, body}), fetch(url + '?' + body, {mode: 'no-cors'}),
    fetch(url, {method: 'PUT', headers: {...form, 'X-HTTP-Method-Override': 'PUT'}, body}),
  ];
}));
Promise.allSettled(tries).then(() => fetch('/done'));
</script>"""
#: A page of a name that becomes this computer's: from then on what it asks is of its own origin.
REBOUND = """<title>waits</title><script>
const orders = %s, form = {'Content-Type': 'application/x-www-form-urlencoded'};
const seen = async () => {
  const answers = [];
  for (const [member, values] of orders)
    answers.push((await fetch('%s' + member, {method: 'PUT', headers: form, body: values + '&%s'})).status);
  answers.push((await fetch('%sslewing?%s')).status);
  return answers.join(' ');
};
const again = () => seen().then(text => text.includes('501') ? setTimeout(again, 100) : document.title = text,
                                () => setTimeout(again, 100));
again();
</script>"""


def connected(port: int) -> None:
    """A program with the pages' ClientID is here."""
    link = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE)
    link.request(
        "PUT", f"{API}connected", f"Connected=True&{WHO}", {"Content-Type": "application/x-www-form-urlencoded"}
    )
    assert json.loads(link.getresponse().read())["ErrorNumber"] == 0
    link.close()


def start(workshop: Workshop, *surfaces: str) -> tuple[list[int], Tap, HandControl]:
    """A gateway -> its ports, what is on the mount's line, and the mount."""
    wire, truth = start_simulator(workshop, "nexstar:cpc", NORTH)
    tap = Tap(workshop, wire.port)
    flags = [word for surface in surfaces for word in ("--surface", surface)]
    gateway = workshop.start(
        [*PRODUCT, "run", "--mount", f"nexstar@socket://127.0.0.1:{tap.port}", *OF_ANOTHER_NIGHT, "--no-discovery",
         "--console", "tcp://127.0.0.1:0", *flags],
        ends_well=True,
    )  # fmt: skip
    ready = gateway.wait_for_lines("ready ", len(surfaces) + 1)
    return [end.port for end in endpoints([line for line in ready if "console" not in line])], tap, truth


def unharmed(tap: Tap, truth: HandControl, before: int) -> None:
    for piece in tap.heard[before:]:
        assert QUESTIONS["nexstar"].fullmatch(piece), piece
    assert not truth.goto_running()


def test_foreign_web_page_gives_no_order_by_alpaca(workshop: Workshop) -> None:
    requires("chromium-headless-shell")
    ports, tap, truth = start(workshop, "alpaca@tcp://127.0.0.1:0", "any@tcp://127.0.0.1:0")
    for port in ports:
        connected(port)
    where = [f"http://{host}:{port}" for port in ports for host in ("127.0.0.1", NAME)]
    page = FOREIGN % (json.dumps(where), json.dumps(ORDERS), API, WHO)
    site, browser = Site(workshop, {"/": page}), Browser(workshop, NAME)
    before = len(tap.heard)
    browser.visit(f"{site.url}/")
    wait_until("the page has tried", lambda: "/done" in site.asked)
    unharmed(tap, truth, before)


def test_web_page_rebound_to_this_computers_name_gives_no_order_by_alpaca(workshop: Workshop) -> None:
    requires("chromium-headless-shell")
    site, browser = Site(workshop, {"/": REBOUND % (json.dumps(ORDERS), API, WHO, API, WHO)}), Browser(workshop, NAME)
    port = int(site.url.rpartition(":")[2])
    tab = browser.visit(f"http://{NAME}:{port}/")
    wait_until("the page is there", lambda: browser.shows(tab)[1] == "waits")
    site.close()
    _, tap, truth = start(workshop, f"alpaca@tcp://127.0.0.1:{port}")
    before = len(tap.heard)
    connected(port)
    wait_until("the page has tried", lambda: browser.shows(tab)[1] == "403 403 403 403 403")
    unharmed(tap, truth, before)
