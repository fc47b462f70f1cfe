"""The list of a departure check: what a car must show, or a person see, before it drives. Pure.

It is data, one table an item, in a profile, in a file beside the settings, or from a page: all are read here.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import orjson
import tomli_w

from monitor.runner import Refused
from server.protocol.departure import DepartureGroup, DepartureKind
from server.storage import bounded_toml
from server.system.clean_text import clean

MOST_ITEMS = 60
MAX_BYTES = 14_000  # of the list as TOML: a page sends it as one command
LONGEST_TITLE = 60
LONGEST_FIX = 300
LONGEST_OF = 200
MOST_DAYS = 3650
MOST_KM = 1_000_000.0
_ID = re.compile(r"[a-z0-9][a-z0-9_-]{0,39}")
_FIELDS = ("id", "title", "kind", "of", "need", "fix", "every_days", "every_km")


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """What one kind of item is about."""

    group: DepartureGroup
    title: str
    of: str = ""  # what `of` names; "": it has none
    unit: str = ""
    need: float | None = None  # the usual value of `need`; None: it has none
    lowest: float = 0.0
    highest: float = 0.0


KINDS: Mapping[DepartureKind, Kind] = {
    "manual": Kind(group="manual", title="By hand"),
    "check": Kind(group="automatic", title="A check is OK", of="check"),
    "topic": Kind(group="automatic", title="Rate of a topic", of="topic", unit="Hz", need=5.0, lowest=0.1, highest=1e3),
    "recorder": Kind(group="automatic", title="The recorder runs"),
    "sound": Kind(group="automatic", title="Sound armed", unit="phones", need=1.0, lowest=1.0, highest=20.0),
    "disk": Kind(group="automatic", title="Disk room", unit="GB", need=5.0, lowest=0.1, highest=1e5),
    "clock": Kind(group="automatic", title="Clock difference", unit="s", need=0.2, lowest=0.01, highest=60.0),
    "brake": Kind(group="active", title="Brake pedal", unit="%", need=20.0, lowest=1.0, highest=100.0),
    "accelerator": Kind(group="active", title="Accelerator pedal", unit="%", need=10.0, lowest=1.0, highest=100.0),
    "steering": Kind(group="active", title="Steering left, then right", unit="°", need=5.0, lowest=0.5, highest=45.0),
    "slow_down": Kind(group="active", title="Slow-down at standstill", unit="s", need=2.0, lowest=0.5, highest=60.0),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Item:
    """One item of the list."""

    id: str
    title: str
    kind: DepartureKind = "manual"
    of: str = ""  # the id of a check, or the name of a topic
    need: float | None = None  # at least; of a clock at most
    fix: str = ""  # what to do where it fails
    every_days: int | None = None  # due again after so long, or so far; neither: at each departure
    every_km: float | None = None

    @property
    def is_recurring(self) -> bool:
        """It is not due at each departure: the logbook shows when it is overdue."""
        return self.every_days is not None or self.every_km is not None

    @property
    def group(self) -> DepartureGroup:
        return KINDS[self.kind].group

    def fingerprint(self) -> str:
        """SHA-256 of what it requires, in hex: a result counts for that, and for no other item of the same id."""
        return hashlib.sha256(orjson.dumps([self.id, self.title, self.kind, self.of, self.need])).hexdigest()

    def as_row(self) -> dict[str, Any]:
        """The row for a file, without empty fields."""
        row = {name: getattr(self, name) for name in _FIELDS}
        return {name: value for name, value in row.items() if value not in ("", None)}


USUAL = (  # of a car whose profile has no list
    Item(id="tyres", title="Tyres, lamps and mirrors"),
    Item(id="doors", title="Boot and doors shut"),
    Item(id="link", title="Link in time", kind="check", of="link_late", fix="Come nearer to the car's access point."),
    Item(
        id="recorder",
        title="Recorder runs",
        kind="recorder",
        fix="A drive that is not recorded cannot be examined later.",
    ),
    Item(
        id="sound",
        title="Sound armed",
        kind="sound",
        need=1.0,
        fix="No operator would hear an alarm. Touch a phone that shows this car, and turn its volume up.",
    ),
)


def of_rows(rows: object) -> tuple[Item, ...]:
    """The list in decoded tables. Raises Refused with one sentence for whatever is wrong."""
    if not isinstance(rows, Sequence) or isinstance(rows, (str, bytes)):
        raise Refused("The departure check must be a list of items.")
    if not rows:
        raise Refused("The departure check needs at least one item.")
    if len(rows) > MOST_ITEMS:
        raise Refused(f"The departure check has at most {MOST_ITEMS} items.")
    items = tuple(_item(row, number) for number, row in enumerate(rows, 1))
    seen: set[str] = set()
    for number, item in enumerate(items, 1):
        if item.id in seen:
            raise Refused(f"Item {number}: the id “{item.id}” is there already.")
        seen.add(item.id)
    if len(to_toml(items).encode()) > MAX_BYTES:
        raise Refused(f"The departure check has at most {MAX_BYTES // 1000} kB: shorten its texts.")
    return items


def from_toml(text: str) -> tuple[Item, ...]:
    """The list in a file: `[[item]]` for each. Raises Refused with one sentence."""
    try:
        body = bounded_toml.loads(text, max_bytes=2 * MAX_BYTES)
    except bounded_toml.BadToml as why:
        raise Refused(str(why)) from None
    unknown = sorted(set(body) - {"item"})
    if unknown:
        raise Refused(f"There is no section named “{_seen(unknown[0])}”: each item begins with [[item]].")
    return of_rows(body.get("item", []))


def to_toml(items: Iterable[Item]) -> str:
    """The list as a file for people."""
    return tomli_w.dumps({"item": [item.as_row() for item in items]})


def _item(row: object, number: int) -> Item:
    if not isinstance(row, Mapping):
        raise Refused(f"Item {number} is not a table.")
    unknown = sorted(str(name) for name in row if name not in _FIELDS)
    if unknown:
        raise Refused(f"Item {number}: there is no field named “{_seen(unknown[0])}”.")
    title = _text(row, "title", number, LONGEST_TITLE)
    if not title:
        raise Refused(f"Item {number} needs a title.")
    kind = next((known for known in KINDS if row.get("kind", "manual") == known), None)
    if kind is None:
        raise Refused(f"Item {number}, “{title}”: a kind is one of {', '.join(KINDS)}.")
    id = row.get("id")
    if not isinstance(id, str) or not _ID.fullmatch(id):
        raise Refused(f"Item {number}, “{title}”: an id has 1 to 40 small letters, digits, - and _.")
    of = _text(row, "of", number, LONGEST_OF)
    wanted = KINDS[kind].of
    if bool(of) != bool(wanted):
        raise Refused(f"Item {number}, “{title}”: " + (f"name its {wanted} in `of`." if wanted else "it has no `of`."))
    return Item(
        id=id, title=title, kind=kind, of=of, need=_need(row, kind, title, number),
        fix=_text(row, "fix", number, LONGEST_FIX),
        every_days=None if (days := _every(row, "every_days", title, number, MOST_DAYS)) is None else round(days),
        every_km=_every(row, "every_km", title, number, MOST_KM),
    )  # fmt: skip


def _every(row: Mapping[Any, Any], name: str, title: str, number: int, most: float) -> float | None:
    value = row.get(name)
    if value is None:
        return None
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not is_number or not 1 <= value <= most or (name == "every_days" and value != int(value)):
        what = "a whole number of days" if name == "every_days" else "a number of kilometres"
        raise Refused(f"Item {number}, “{title}”: `{name}` is {what} from 1 to {most:.0f}.")
    return float(value)


def _need(row: Mapping[Any, Any], kind: DepartureKind, title: str, number: int) -> float | None:
    about = KINDS[kind]
    value = row.get("need", about.need)
    if about.need is None:
        if value is not None:
            raise Refused(f"Item {number}, “{title}”: it has no `need`.")
        return None
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not is_number or not math.isfinite(value) or not about.lowest <= value <= about.highest:
        raise Refused(
            f"Item {number}, “{title}”: `need` is a number from {about.lowest:g} to {about.highest:g} {about.unit}."
        )
    return float(value)


def _text(row: Mapping[Any, Any], name: str, number: int, longest: int) -> str:
    value = row.get(name, "")
    if not isinstance(value, str):
        raise Refused(f"Item {number}: `{name}` must be text.")
    found = " ".join(clean(value[: 4 * longest]).split())
    if len(found) > longest:
        raise Refused(f"Item {number}: `{name}` has at most {longest} characters.")
    return found


def _seen(name: str) -> str:
    return clean(name, 40)
