"""Which addresses this computer has, and which of them a person types into a phone to reach a surface."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from ipaddress import IPv4Address, IPv6Address

from gateway.app.discovery.offer import EVERYWHERE, Offer
from gateway.app.discovery.skyfi import seen_from
from gateway.system.own_names import held

Held = Iterable[tuple[str, IPv4Address | IPv6Address]]

#: Networks within this computer, of containers and virtual machines: nobody comes from there.
_INNER = ("docker", "br-", "veth", "virbr", "vmnet", "vboxnet", "lxc", "lxd", "podman")
#: Somebody far away (of a network that is kept for examples): the way there begins at the address most people mean.
_FAR = ("192.0.2.1", 9)


def to_type(
    offer: Offer, every: Callable[[], Held] = held, first: Callable[[tuple[str, int]], str] = seen_from
) -> list[str]:
    """The addresses at which other computers reach an offer, the likeliest first; those of IPv6 only without others."""
    if offer.host not in EVERYWHERE:
        return [offer.host] if offer.wide else []
    outer = [
        address
        for name, address in every()
        if not (address.is_loopback or address.is_link_local or name.lower().startswith(_INNER))
    ]
    old = [str(address) for address in outer if address.version == 4]
    new = [str(address) for address in outer if address.version == 6] if offer.host == "::" else []
    likeliest = first(_FAR)
    return sorted(dict.fromkeys(old or new), key=lambda address: address != likeliest)


def in_words(offer: Offer, addresses: list[str]) -> str:
    """The line for a person with a phone or another computer."""
    if not addresses:
        return f"no other computer reaches port {offer.port}: this one is in no network now"
    where = " or ".join(addresses)
    if offer.scheme != "tcp":
        return f"on another computer: {offer.scheme}://{where}:{offer.port}"
    return f"on your phone: {where}, port {offer.port}"
