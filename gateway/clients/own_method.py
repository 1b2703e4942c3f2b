"""An HTTP request whose method is no known one: a web page may choose any word where it was given our address.

(DNS rebinding: the page's own name points here, so the browser asks nobody.) Whatever the word, a blank, the ``/`` of
the address and two printable characters follow; no program for telescopes begins so, though a latitude of 32°47' comes
near. The word itself holds nothing up, because every single letter may be a command.
"""

from __future__ import annotations

#: What a method may consist of (RFC 9110), what an address may, and the longest word that is looked at.
_WORD = frozenset(b"!#$%&'*+-.^_`|~0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz")
_PRINTABLE = frozenset(range(0x20, 0x7F))
_BEHIND = (frozenset(b" "), frozenset(b"/"), _PRINTABLE, _PRINTABLE)
LONGEST = 65536


class OwnMethod:
    """Hears a connection from its first byte on, in pieces of any size. ``idle`` bytes may come before."""

    def __init__(self, idle: bytes) -> None:
        self._idle = idle
        self._letters, self._behind = 0, 0
        #: Whether such a request may still come.
        self.possible = True

    @property
    def begun(self) -> bool:
        """Whether the blank has come: what follows is not to be heard before it is known what it is."""
        return self.possible and self._behind > 0

    def hear(self, data: bytes) -> bool:
        """More bytes have come -> whether they complete what such a request begins with."""
        for byte in data if self.possible else b"":
            if not self._letters and byte in self._idle:
                continue
            if self._letters and byte in _BEHIND[self._behind]:
                self._behind += 1
                if self._behind == len(_BEHIND):
                    self.possible = False
                    return True
            elif self._behind or byte not in _WORD or self._letters == LONGEST:
                self.possible = False
                break
            else:
                self._letters += 1
        return False
