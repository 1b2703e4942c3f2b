"""Mounts by the words that are on them: ``6se``, ``cpc``, ``lx200gps``, besides ``PROTOCOL[:MODEL[/VERSION]]``."""

from __future__ import annotations

import re

from gateway.config.endpoints import PROTOCOLS, Endpoint, nearest, parse_device
from gateway.errors import UserError
from gateway.tables import load

#: What owners call a mount, without blanks and marks -> protocol and model; a model's own name needs no row here.
_CALLED = {
    "4se": "nexstar:4-5se", "5se": "nexstar:4-5se", "6se": "nexstar:6-8se", "8se": "nexstar:6-8se",
    "advancedvx": "nexstar:avx", "cgempro": "nexstar:cgem", "cgepro": "nexstar:cge-pro", "evo": "nexstar:evolution",
    "nexstar8gps": "nexstar:nexstar-gps", "nexstar11gps": "nexstar:nexstar-gps", "celestron": "nexstar",
    "meade": "lx200", "lx200classic": "lx200:lx200", "classic": "lx200:lx200", "lx20016": "lx200:lx200-16",
    "lx90": "lx200:autostar", "etx": "lx200:autostar",
}  # fmt: skip
_MAKERS = re.compile("^(celestron|meade|nexstar)(?=.)")


def parse_words(text: str) -> Endpoint:
    """A device for ``parse_device``, or a model's word alone, with or without ``/VERSION``. Raises UserError."""
    name, slash, version = text.partition("/")
    if name.partition(":")[0] in PROTOCOLS:
        return parse_device(text)
    plain = _plain(name)
    known = {_plain(model): f"{protocol}:{model}" for protocol in PROTOCOLS for model in load(protocol).models
             if model not in PROTOCOLS} | _CALLED
    device = known.get(plain) or known.get(_MAKERS.sub("", plain))
    if device is None:
        models = [model for protocol in PROTOCOLS for model in load(protocol).models]
        raise UserError(f"{text!r} is no protocol ({', '.join(PROTOCOLS)}) and no model; {nearest(name, models)}")
    return parse_device(device + slash + version)


def _plain(word: str) -> str:
    return re.sub("[^a-z0-9]", "", word.lower())
