"""What all clients have in common, as one sees it that may only look: it can be read, and changing it is refused."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from gateway.core.errors import ReadOnly


class Sealed(Mapping[str, Any]):
    """What all clients have in common, for one that may not change it. ``refused`` is called when it tries."""

    def __init__(self, inner: Mapping[str, Any], refused: Callable[[], None]) -> None:
        self._inner, self._refused = inner, refused

    def __getitem__(self, name: str) -> Any:
        value = self._inner[name]
        return Sealed(value, self._refused) if isinstance(value, dict) else value

    def __iter__(self) -> Iterator[str]:
        return iter(self._inner)

    def __len__(self) -> int:
        return len(self._inner)

    def __setitem__(self, name: str, value: Any) -> None:
        self.refuse()

    def refuse(self) -> None:
        """What a client does before it changes anything that is kept elsewhere. Raises ReadOnly."""
        self._refused()
        raise ReadOnly

    def setdefault(self, name: str, value: Any) -> Any:
        """Raises ReadOnly even where there is such a name: whoever calls this is about to change it."""
        self[name] = value
