"""Turns requests of a page into orders to a mount, through the same functions as the commands of the command line.

So the same limits apply, the refusals have the same words, and the orders appear in recordings like everything that
comes from outside.
"""

from __future__ import annotations

from gateway.app.control.exchange import new_number
from gateway.app.control.orders import orders
from gateway.app.control.requests import DONE
from gateway.app.gateway import Gateway
from gateway.console import messages
from gateway.console.places import target_of
from gateway.core import requests

_WORD = {"stopped": "stopped", "held": "stopped and held", "released": "released"}


async def order(gateway: Gateway, word: str) -> tuple[bool, str]:
    """Carry out ``stop``, ``hold`` or ``release`` like ``mount-gateway stop``. Return success and a message."""
    assert gateway.store is not None
    answer = await orders(gateway.controller, gateway.store, gateway.entrance)[word]()
    return (True, _WORD[answer]) if answer in _WORD else (False, answer.removeprefix("failed "))


async def carry_out(gateway: Gateway, command: requests.Request) -> tuple[bool, str]:
    """Carry out an order. Return whether it was done or begun, and a message."""
    answer = await gateway.entrance.handle_request(requests.encode(command), gateway.request_handler.carry_out)
    word, _, rest = answer.partition(" ")
    return word == DONE, rest


async def command(request: messages.Command, who: str) -> requests.Request:
    """Return the order for a request. Raises UserError for an unknown object."""
    number = new_number()
    match request:
        case messages.Goto():
            return requests.Goto(number, await target_of(request), who=who)
        case messages.Sync():
            return requests.Sync(number, await target_of(request), who=who)
        case messages.Track():
            return requests.Track(number, request.on, request.rate, who=who)
        case messages.Time():
            return requests.TellTime(number, request.unix, request.offset, who=who)
        case messages.Site():
            return requests.TellSite(number, request.latitude, request.longitude, who=who)
        case messages.Park():
            return requests.Park(number, who=who)
        case messages.Home():
            return requests.Home(number, who=who)
        case messages.Unpark() | messages.Wake():
            return requests.Unpark(number, who=who)
