"""The departure check of one drive: each item done, failed or not applicable, then signed by a person. Pure.

Times of day are in ms since 1970, `now_s` is on a monotonic clock. Automatic and active items change by measurements.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import orjson

from monitor.runner import Refused
from server.control.departure_list import Item
from server.control.departure_sight import Peak, Seen, judge, see
from server.protocol.departure import DepartureCounts, DepartureResult, DepartureStep, RecurringItem
from server.system.clean_text import clean

DONE_AFTER_S = 1.0  # so long an automatic item must be good before it turns
FAILED_AFTER_S = 2.0
MOST_TURNS = 20  # of one automatic item in the log: one that flaps must not fill it
LONGEST_NOTE = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """What became of one item. `given_for`: its fingerprint; of an old log its title."""

    given_for: str = ""
    result: DepartureResult = "open"
    value: str = ""
    note: str = ""
    by: str | None = None
    at_ms: int | None = None
    is_fixed: bool = False  # it had failed in this check


@dataclass(frozen=True, slots=True, kw_only=True)
class Signature:
    """Who signed what; `document` is the canonical JSON, "" where it is not known any more."""

    by: str
    role: str
    at_ms: int
    counts: DepartureCounts
    fixed: int
    hash: str
    document: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """What is to be logged."""

    step: DepartureStep
    item: Item | None = None
    result: Result = field(default_factory=Result)


@dataclass(slots=True)
class _Turning:
    """An automatic item that is about to turn."""

    to: DepartureResult
    since_s: float


OPEN = Result()


class DepartureCheck:
    """Of one car. Raises Refused with a sentence."""

    def __init__(self, items: Sequence[Item] = ()) -> None:
        self._adopt(items)
        self._clear()

    def _adopt(self, items: Sequence[Item]) -> None:
        self.items: tuple[Item, ...] = tuple(items)
        self._prints = {one.id: one.fingerprint() for one in self.items}

    def _clear(self) -> None:
        self.id: str | None = None  # None: not begun in this drive
        self.by: str | None = None
        self.begun_ms: int | None = None
        self.results: dict[str, Result] = {}
        self.signature: Signature | None = None
        self.peaks: dict[str, Peak] = {}
        self._turning: dict[str, _Turning] = {}
        self._turns: dict[str, int] = {}
        self._unlogged: set[str] = set()  # items whose newest result is not in the log

    # -- what people do ----------------------------------------------------------------------------------------------

    def begin(self, id: str, by: str | None, at_ms: int) -> Change:
        """Begins, or begins again."""
        self._clear()
        self.id, self.by, self.begun_ms = id, by, at_ms
        return Change(step="begun")

    def end(self) -> None:
        """The drive is over: discard the check."""
        self._clear()

    def set_item(self, name: str, result: DepartureResult, note: str, by: str, at_ms: int) -> Change:
        """A result that a person gives to one item."""
        self._demand_open()
        item = next((one for one in self.items if one.id == name), None)
        if item is None:
            raise Refused("This item is not in the departure check any more.")
        note = " ".join(clean(note).split())[:LONGEST_NOTE]
        if result in ("failed", "not_applicable") and not note:
            raise Refused("Say why: choose a reason or type one.")
        if result == "done" and item.group != "manual":
            how = "do it, and it is seen" if item.group == "active" else "it turns by itself"
            raise Refused(f"“{item.title}” is not ticked by hand: {how}.")
        if result == "failed" and item.group == "automatic":
            raise Refused(f"“{item.title}” turns by itself.")
        if result in ("open", "failed"):
            self.peaks.pop(name, None)
        if result == "open":
            new = Result(is_fixed=self._was_failed(item))
        else:
            new = Result(result=result, note=note, by=by, at_ms=at_ms, is_fixed=self._was_failed(item))
        self._turning.pop(name, None)
        return self._turn(item, new)

    def sign(self, check: str, by: str, role: str, at_ms: int) -> list[Change]:
        """The changes that the log does not have yet, and the signature."""
        self._demand_open()
        if check != self.id:
            raise Refused("The departure check was begun again: look at it once more.")
        left = self.counts()
        open_ = left["of"] - left["done"] - left["failed"] - left["not_applicable"]
        if left["failed"] or open_:
            parts = [f"{left['failed']} failed"] * bool(left["failed"]) + [f"{open_} open"] * bool(open_)
            raise Refused(f"Not ready: {', '.join(parts)}.")
        unlogged = [
            Change(step="item", item=one, result=self.result(one)) for one in self.items if one.id in self._unlogged
        ]
        self._unlogged.clear()
        document = self.document()
        self.signature = Signature(
            by=by,
            role=role,
            at_ms=at_ms,
            counts=left,
            fixed=sum(one.result == "done" and one.is_fixed for one in map(self.result, self.items)),
            hash=hashlib.sha256(document.encode()).hexdigest(),
            document=document,
        )
        return [*unlogged, Change(step="signed")]

    def reopen(self) -> Change:
        if self.signature is None:
            raise Refused("The departure check is not signed.")
        self.signature = None
        self._turning.clear()
        self.results = {one.id: self.results[one.id] for one in self.items if self.result(one) is not OPEN}
        return Change(step="reopened")

    def change_list(self, items: Sequence[Item]) -> None:
        """Replace the list: an item that changed is open again. A signed result stays as it was signed."""
        before = self._prints
        self._adopt(items)
        kept = {name for name, print_ in self._prints.items() if before.get(name, print_) == print_}
        if self.signature is None:
            self.results = {name: one for name, one in self.results.items() if name in kept or name not in before}
        self.peaks = {name: one for name, one in self.peaks.items() if name in kept}
        self._turning = {name: one for name, one in self._turning.items() if name in kept}

    # -- what is seen ------------------------------------------------------------------------------------------------

    def look(self, seen: Seen, now_s: float, at_ms: int) -> list[Change]:
        """Automatic items turn, active ones pass as soon as they were seen. What is to be logged."""
        if self.id is None or self.signature is not None:
            return []
        changes = []
        for item in self.items:
            had = self.result(item)
            if had.result == "not_applicable" or item.group == "manual":
                continue
            turn = self._act if item.group == "active" else self._automatic
            if (change := turn(item, had, seen, now_s, at_ms)) is not None:
                changes.append(change)
        return changes

    def _act(self, item: Item, had: Result, seen: Seen, now_s: float, at_ms: int) -> Change | None:
        if had.result in ("done", "failed"):  # only a person marks one as failed
            return None
        peak = self.peaks[item.id] = see(item, self.peaks.get(item.id, Peak()), seen, now_s)
        if not peak.is_reached:
            return None
        is_fixed = self._was_failed(item)
        return self._turn(item, Result(result="done", value=peak.value, at_ms=at_ms, is_fixed=is_fixed))

    def _automatic(self, item: Item, had: Result, seen: Seen, now_s: float, at_ms: int) -> Change | None:
        verdict, value = judge(item, seen)
        if verdict == had.result:
            self._turning.pop(item.id, None)
            self._keep(item, had if had.result == "done" and had.value else replace(had, value=value))
            return None
        turning = self._turning.get(item.id)
        if turning is None or turning.to != verdict:
            turning = self._turning[item.id] = _Turning(verdict, now_s)
        is_first = item.id not in self._turns  # what is good at first is reported at once
        settles_s = FAILED_AFTER_S if verdict != "done" else 0.0 if is_first else DONE_AFTER_S
        if now_s - turning.since_s < settles_s:
            return None
        del self._turning[item.id]
        is_fixed = self._was_failed(item)
        new = Result(result=verdict, value=value, at_ms=None if verdict == "open" else at_ms, is_fixed=is_fixed)
        self._turns[item.id] = self._turns.get(item.id, 0) + 1
        if self._turns[item.id] <= MOST_TURNS:
            return self._turn(item, new)
        self._keep(item, new)
        self._unlogged.add(item.id)
        return None

    def _turn(self, item: Item, result: Result) -> Change:
        result = self._keep(item, result)
        self._unlogged.discard(item.id)
        return Change(step="item", item=item, result=result)

    def _keep(self, item: Item, result: Result) -> Result:
        result = self.results[item.id] = replace(result, given_for=self._prints[item.id])
        return result

    def _was_failed(self, item: Item) -> bool:
        had = self.result(item)
        return had.result == "failed" or had.is_fixed

    def _demand_open(self) -> None:
        if self.id is None:
            raise Refused("The departure check is not begun yet.")
        if self.signature is not None:
            raise Refused("The departure check is signed: reopen it first.")

    # -- what it is --------------------------------------------------------------------------------------------------

    def result(self, item: Item) -> Result:
        """Open where what was kept was given for another item of this id."""
        found = self.results.get(item.id, OPEN)
        return found if found.given_for in (self._prints.get(item.id), item.title) else OPEN

    def counts(self) -> DepartureCounts:
        if self.signature is not None:
            return self.signature.counts
        found = [self.result(one).result for one in self.items]
        return {
            "done": found.count("done"),
            "failed": found.count("failed"),
            "not_applicable": found.count("not_applicable"),
            "of": len(found),
        }

    def recurring(self) -> list[RecurringItem]:
        """The items that have an interval, and whether they were done now; the logbook states when they are due."""
        return [
            {
                "item": one.id, "title": one.title, "every_days": one.every_days, "every_km": one.every_km,
                "is_done": self.result(one).result == "done",
            }
            for one in self.items
            if one.is_recurring
        ]  # fmt: skip

    def document(self) -> str:
        """The list and its results as canonical JSON: sorted keys, no spaces. What is signed is the hash of it."""
        rows = [
            {
                "id": one.id,
                "title": one.title,
                "kind": one.kind,
                "of": one.of,
                "need": one.need,
                **_signed_fields(self.result(one)),
            }
            for one in self.items
        ]
        return orjson.dumps({"check": self.id, "items": rows}, option=orjson.OPT_SORT_KEYS).decode()

    def restore(
        self, *, id: str, by: str | None, begun_ms: int, results: Mapping[str, Result], signature: Signature | None
    ) -> None:
        """The check of before a restart, as the log has it. Results of items that have changed do not count."""
        self._clear()
        self.id, self.by, self.begun_ms = id, by, begun_ms
        self.results = dict(results)
        self.signature = signature
        if signature is not None:
            document = self.document()
            if hashlib.sha256(document.encode()).hexdigest() == signature.hash:
                self.signature = replace(signature, document=document)


def _signed_fields(result: Result) -> dict[str, str | None]:
    return {"result": result.result, "value": result.value, "note": result.note, "by": result.by}
