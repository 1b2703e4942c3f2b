"""Who may speak to the console: its own page, in a browser that reached it by an address of this computer.

A page of somebody else's that runs in the same browser may send requests here, or have its own name point here (DNS
rebinding). So ``Host`` must be an address or a name of this computer, ``Origin`` must be the page's own, and whatever
acts needs the token that only the served page holds. The port is not compared: an SSH tunnel may have another one.
"""

from __future__ import annotations

import hmac
from collections.abc import Mapping

from gateway.system.own_names import host_of

#: Everything the page needs comes from here; nothing else is loaded, framed or run.
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
        "manifest-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Frame-Options": "DENY",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}


def same_origin(origin: str | None, host: str | None) -> bool:
    """Whether a request comes from the page itself. One without ``Origin`` comes from no page of somebody else's."""
    if origin is None:
        return True
    scheme, _, rest = origin.partition("://")
    return scheme in ("http", "https") and host_of(rest) == host_of(host or "")


def from_elsewhere(headers: Mapping[str, str]) -> bool:
    """Whether the browser itself says that another site's page sends this."""
    return headers.get("Sec-Fetch-Site", "none") not in ("none", "same-origin")


def of_the_page(headers: Mapping[str, str], path: str) -> bool:
    """Whether a request comes from the page itself; for the page everybody may ask who typed its address."""
    own = same_origin(headers.get("Origin"), headers.get("Host"))
    return own and (path == "/" or not from_elsewhere(headers))


def same_token(given: str | None, token: str) -> bool:
    """Compared in a time that tells nothing."""
    return hmac.compare_digest((given or "").encode(), token.encode())
