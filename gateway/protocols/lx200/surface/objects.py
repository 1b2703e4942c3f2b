"""The object library: an object that a client selects becomes its target for :MS#; and the limits of searches.

The Moon, places on it and planets move: the session stores the object, and its position is computed at every goto. If a
catalogue or an object is refused, nothing is selected, so that no goto leads to the previous object. The classic models
search by the limits that :S sets. On the others LB, LF and LN do nothing and Lf, LI and Lo give the manual's fixed
replies, but LC, LM and LS work, as in their later firmware. If the surface presents the mount's own model, the mount's
library is used.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from msgspec.structs import replace

from gateway.astro.catalog import deepsky, stars
from gateway.astro.catalog.objects import QUALITIES, CatalogObject, SearchLimits, describe
from gateway.astro.spherical import separation
from gateway.core import operations as op
from gateway.core.errors import Fault, Invalid, Unsupported
from gateway.protocols.base.wants import Handling, decoded
from gateway.protocols.lx200.session import LxSession
from gateway.protocols.wireformat.command import Command

_CATALOG_BY_NUMBER = {0: "NGC", 1: "IC", 2: "UGC", 3: "C"}  # of :Lo; Arp and Abell (4 and 5) are not available
_STAR_CATALOG, _HIPPARCOS_CATALOG = 0, 3  # of :Ls; SAO, GCVS, HR and HD (1, 2, 4, 5) are not available
#: The numbers of the STAR catalogue from 901 on. Its 351 alignment stars and Pluto (909) are not available.
_PLANETS = {901: "Mercury", 902: "Venus", 904: "Mars", 905: "Jupiter", 906: "Saturn", 907: "Uranus", 908: "Neptune"}
_MOON_NUMBER = 903
_NOT_FOUND = "Catalog not found"
#: Command -> the command that chooses its catalogue. It is sent again first: another client may have chosen another.
_CHOOSER_BY_COMMAND = {"LC": "Lo", "LS": "Ls", "LF": "Lo", "LN": "Lo", "LB": "Lo"}
_CHOOSERS = ("Lo", "Ls")
_YEAR_SECONDS = 365.25 * 86400.0
#: The search limit of a letter of :G and :S.
_LIMITS = {"b": "brighter", "f": "fainter", "F": "field", "l": "larger", "s": "smaller", "y": "types", "q": "quality"}
_TYPES = re.compile("gpdco", re.IGNORECASE)


def choose_catalog(session: LxSession, values: op.Values) -> None:
    """:Lo - choose a catalogue; on models that do not search the reply is always 1."""
    catalog = None if "fault" in values else _CATALOG_BY_NUMBER.get(values["catalog"])
    session.client.deep_sky_catalog = catalog
    if catalog is None:
        session.client.select_nothing(_NOT_FOUND)
    if session.model["libraries"]:
        if catalog is None:
            raise Invalid(_NOT_FOUND)
        _check_installed(session, lambda: deepsky.look_up(catalog, 1))


def choose_stars(session: LxSession, values: op.Values) -> None:
    """:Ls - choose a catalogue: planets, or Hipparcos."""
    catalog = None if "fault" in values else values["catalog"]
    session.client.star_catalog = catalog if catalog in (_STAR_CATALOG, _HIPPARCOS_CATALOG) else None
    if session.client.star_catalog is None:
        session.client.select_nothing(_NOT_FOUND)
        raise Invalid(_NOT_FOUND)
    if catalog == _HIPPARCOS_CATALOG:
        _check_installed(session, lambda: stars.hipparcos_star(1, 2000.0))


def _check_installed(session: LxSession, look_up: Callable[[], object]) -> None:
    """Raise Invalid and select nothing if the catalogue is not installed."""
    try:
        look_up()
    except Unsupported as missing:
        session.client.select_nothing(str(missing))
        raise Invalid(_NOT_FOUND) from None


def select_object(session: LxSession, command: Command, values: op.Values) -> Handling:
    """:LM :LC - select a Messier object, or an object of the catalogue that :Lo chose."""
    catalog = "M" if command.name == "LM" else session.client.deep_sky_catalog
    yield from _select_by_number(session, catalog, values, deepsky.look_up)


def select_star(session: LxSession, values: op.Values) -> Handling:
    """:LS - select from the catalogue that :Ls chose; by default STAR on models that have it, else Hipparcos."""
    catalog = session.client.star_catalog
    if catalog == "model":
        catalog = _STAR_CATALOG if session.model["libraries"] else _HIPPARCOS_CATALOG
    number, year = values.get("number"), 1970.0 + session.clock() / _YEAR_SECONDS
    if catalog is None or number is None:
        session.client.select_nothing(_NOT_FOUND if catalog is None else "No star selected")
    elif catalog == _HIPPARCOS_CATALOG:
        yield from _select_by_number(session, "HIP", values, lambda _, number: stars.hipparcos_star(number, year))
    elif number == _MOON_NUMBER:
        yield from _set_target(session, op.MoonPlace(), "MOON")
    elif number in _PLANETS:
        yield from _set_target(session, op.PlanetPlace(_PLANETS[number]), f"{_PLANETS[number].upper()} PLANET")
    else:
        session.client.select_nothing(f"STAR {number} not found")


def _select_entry(session: LxSession, entry: CatalogObject) -> Handling:
    """Make an object of a catalogue the target."""
    place: op.Equatorial = yield op.ToEquinoxOfDate(entry.ra, entry.dec)
    client = session.client
    client.deselect()
    client.ra, client.dec, client.selected_entry, client.object_text = place.ra, place.dec, entry, describe(entry)


def _set_target(session: LxSession, moving_object: op.MoonPlace | op.PlanetPlace, text: str) -> Handling:
    """Make a moving object the target. If its position is unknown, nothing is selected and Fault is raised."""
    client = session.client
    try:
        place: op.Equatorial = yield moving_object
    except Fault as fault:
        client.select_nothing(str(fault))
        raise
    client.deselect()
    client.ra, client.dec, client.moving_object, client.object_text = place.ra, place.dec, moving_object, text


def set_moon_target(session: LxSession, values: op.Values) -> Handling:
    """:SE latitude, north positive; :Se longitude, EAST positive (Mare Crisium is +59). A coordinate not set is 0."""
    if "fault" in values:
        session.client.select_nothing("No object selected")
        raise values["fault"]
    place = session.client.moon_place = replace(session.client.moon_place, **values)
    yield from _set_target(session, place, f"MOON LAT {place.latitude:+.1f} LONG {place.longitude:+.1f}")


def _select_by_number(
    session: LxSession, catalog: str | None, values: op.Values, look_up: Callable[[str, int], CatalogObject | None]
) -> Handling:
    """Make the object of that number the target; if there is none, nothing is selected."""
    number = values.get("number")
    if catalog is None or number is None:
        return session.client.select_nothing(_NOT_FOUND if catalog is None else "No object selected")
    try:
        entry = look_up(catalog, number)
    except Unsupported as missing:
        return session.client.select_nothing(str(missing))
    if entry is None:
        session.client.select_nothing(f"{catalog} {number} not found")
    else:
        yield from _select_entry(session, entry)


# --- searching --------------------------------------------------------------------------------------------------------


def tell_search_limit(session: LxSession, command: Command) -> object:
    """:Gb :Gf :GF :Gl :Gs :Gy :Gq - the limits of a search."""
    return getattr(session.client.search, _LIMITS[command.name[1]])


def set_search_limit(session: LxSession, command: Command, values: op.Values) -> None:
    """:Sb :Sf :SF :Sl :Ss :Sy - set a limit; the types are five letters in fixed order, those wanted in capitals."""
    name = _LIMITS[command.name[1]]
    (value,) = decoded(values).values()
    if name == "types" and not _TYPES.fullmatch(value):
        raise Invalid("The types are GPDCO, capitals for those wanted.")
    session.client.search = replace(session.client.search, **{name: value})


def step_quality(session: LxSession) -> None:
    """:Sq - the next lower quality, from the worst back to the best."""
    present = QUALITIES.index(session.client.search.quality)
    session.client.search = replace(session.client.search, quality=QUALITIES[(present + 1) % len(QUALITIES)])


def browse(session: LxSession, command: Command) -> Handling:
    """:LF - select the first object within the limits, from the west; :LN, :LB - the next or the previous object."""
    if not session.model["libraries"]:
        return
    try:
        candidates = deepsky.find_matches(_search_query(session))
        visible, meridian = yield from _visibility(session)
        entry = session.client.selected_entry
        if entry is None or command.name == "LF":
            row = deepsky.first_visible(candidates, visible, meridian)
        else:
            row = deepsky.neighbour(candidates, visible, entry.ra, entry.dec, -1 if command.name == "LB" else 1)
        if row is None:
            session.client.select_nothing("No object found")
        else:
            yield from _select_entry(session, deepsky.object_by_row(row[0]))
    except Unsupported as missing:
        session.client.select_nothing(str(missing))


def describe_field(session: LxSession) -> Handling:
    """:Lf - report how many objects within the limits are in the field, and which is nearest to its centre."""
    if not session.model["libraries"]:
        return {"text": session.model["find_text"]}
    try:
        candidates = deepsky.find_matches(_search_query(session))
        visible, _ = yield from _visibility(session)
        position: op.Equatorial = yield op.Position()
        centre: op.Equatorial = yield op.ToJ2000(position.ra, position.dec)
        radius = session.client.search.field / 120.0
        objects = [c for c in deepsky.candidates_in_field(candidates, centre.ra, centre.dec, radius) if visible(*c[1:])]
        nearest = f" {describe(deepsky.object_by_row(objects[0][0]))}" if objects else ""
        return {"text": f"{len(objects)} - Objects found{nearest}"}
    except Unsupported as missing:
        return {"text": str(missing)}


def object_text(session: LxSession) -> dict[str, str]:
    """:LI - the description of the selected object."""
    if not session.model["libraries"]:
        return {"text": session.model["object_text"]}
    return {"text": session.client.object_text or "No object selected"}


def _search_query(session: LxSession) -> SearchLimits:
    """Return this client's search limits as a query of the catalogue."""
    limits = session.client.search
    kinds = "".join(letter for letter in limits.types if letter.isupper())
    return SearchLimits(limits.brighter, limits.fainter, limits.larger, limits.smaller, kinds, limits.quality)


def _visibility(session: LxSession) -> Handling:
    """Return a function that reports whether a J2000 position is up and within the limits now, and the meridian's RA.
    Without a site the function always returns True, and the RA is 0. Degrees.
    """
    limits = session.limits
    try:
        zenith: op.Equatorial = yield op.Zenith()
    except Unsupported:
        return lambda ra, dec: True, 0.0
    farthest, nearest = 90.0 - max(0.0, limits.lowest), 90.0 - limits.highest
    return lambda ra, dec: nearest <= separation(zenith.ra, zenith.dec, ra, dec) <= farthest, zenith.ra


# --- the telescope's own library --------------------------------------------------------------------------------------


def use_mount_library(session: LxSession, command: Command, values: op.Values) -> Handling:
    """:Lo :Ls :LC :LM :LS :LF :LN :LB :LI - pass the command on to the mount's own object library."""
    client = session.client
    if command.name == "LI":
        return (
            (yield op.NativeRequest("LI", (), "moment"))
            if client.object_text is None
            else f"{client.object_text}#".encode("latin-1")
        )
    if command.name in _CHOOSERS:
        others = {name: fields for name, fields in client.mount_catalogs.items() if name != command.name}
        try:
            answer = yield op.PassThrough(command.name, tuple(values.items()))
        except Fault:
            client.mount_catalogs = others
            raise
        client.mount_catalogs = {**others, command.name: tuple(values.items())}
        return answer
    catalogue = _CHOOSER_BY_COMMAND.get(command.name, "")
    chosen_by = client.mount_catalogs.get(catalogue)
    first = () if chosen_by is None else ((catalogue, chosen_by),)
    chosen: op.Chosen = yield op.Choose(command.name, tuple(values.items()), first, client.ra or 0.0, client.dec or 0.0)
    if chosen.place is not None:
        client.deselect()
        client.ra, client.dec, client.object_text = chosen.place.ra, chosen.place.dec, chosen.text
    return chosen.reply
