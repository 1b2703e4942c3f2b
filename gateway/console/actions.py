"""Turns requests of a page into orders to a mount, through the same functions as the commands of the command line.

So the same limits apply, the refusals have the same words, and the orders appear in recordings like everything that
comes from outside.
"""

from __future__ import annotations

from gateway.app.control import request_types
from gateway.app.control.exchange import new_number
from gateway.app.control.orders import orders
from gateway.app.control.requests import DONE
from gateway.app.gateway import Gateway
from gateway.console import requests
from gateway.console.places import target_of

_WORD = {"stopped": "stopped", "held": "stopped and held", "released": "released"}


async def order(gateway: Gateway, word: str) -> tuple[bool, str]:
    """Carry out ``stop``, ``hold`` or ``release`` like ``mount-gateway stop``. Return success and a message."""
    assert gateway.store is not None
    answer = await orders(gateway.controller, gateway.store, gateway.entrance)[word]()
    return (True, _WORD[answer]) if answer in _WORD else (False, answer.removeprefix("failed "))


async def carry_out(gateway: Gateway, command: request_types.Request) -> tuple[bool, str]:
    """Carry out an order. Return whether it was done or begun, and a message."""
    answer = await gateway.entrance.handle_request(request_types.encode(command), gateway.request_handler.carry_out)
    word, _, rest = answer.partition(" ")
    return word == DONE, rest


async def command(request: requests.Command, who: str) -> request_types.Request:
    """Return the order for a request. Raises UserError for an unknown object."""
    number = new_number()
    match request:
        case requests.Goto():
            return request_types.Goto(number, await target_of(request), who=who)
        case requests.Sync():
            return request_types.Sync(number, await target_of(request), who=who)
        case requests.Track():
            return request_types.Track(number, request.on, request.rate, who=who)
        case requests.Time():
            return request_types.TellTime(number, request.unix, request.offset, who=who)
        case requests.Site():
            return request_types.TellSite(number, request.latitude, request.longitude, who=who)
        case requests.Park():
            return request_types.Park(number, who=who)
        case requests.Home():
            return request_types.Home(number, who=who)
        case requests.Unpark() | requests.Wake():
            return request_types.Unpark(number, who=who)
