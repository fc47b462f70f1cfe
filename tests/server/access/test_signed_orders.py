"""Which orders an agent carries out, of those that a web node passes on."""

from __future__ import annotations

import re
import time
from pathlib import Path
from threading import Event
from typing import Any

import pytest

from server.access.order_keys import FILE, MOST, BadList, KnownDevices, OrderKeys, read_list
from server.access.order_signer import OrderSigner
from server.access.signed_orders import (
    ALTERED,
    ALWAYS_OF_ONE,
    FORGED,
    FULL,
    LIVES_S,
    MOST_OF_ONE,
    MOST_REMEMBERED,
    NOT_SIGNED,
    OTHER_CAR,
    REPLAYED,
    TOO_MANY,
    TOO_OLD,
    SignedOrders,
)
from server.bus.bus import NotAdmitted
from server.protocol import commands
from server.protocol.signed_order import short
from server.storage.storage_thread import StorageThread
from tests.tree import PROJECT

ANN, BEN = OrderSigner(), OrderSigner()
PAGE = "0123abcd"


class Agent:
    """Of the car ocelot, at a clock that the test moves."""

    def __init__(
        self,
        folder: Path | None = None,
        *,
        required: bool = True,
        known: Path | None = None,
        storage: StorageThread | None = None,
    ) -> None:
        self.now_s = 1000.0
        self.log: list[tuple[str, str]] = []
        self.orders = SignedOrders(
            OrderKeys(folder),
            known=None if known is None else KnownDevices(known, storage=storage, now=lambda: self.now_s),
            is_required=required,
            now=lambda: self.now_s,
            wall_ms=lambda: round(self.now_s * 1000),
            note=lambda vehicle, by, text: self.log.append((by, text)),
        )

    def signed(self, by: OrderSigner = ANN, name: str = "Ann", vehicle: str = "ocelot", **command: Any) -> Any:
        """As a node passes it on."""
        command_text = {"kind": "pause", "fence": 3, **command}
        challenge = self.orders.challenge()
        signed = by.sign(command_text, vehicle=vehicle, by=name, challenge=challenge, page=PAGE)
        return {"kind": command_text["kind"], "id": "p1", "signed": signed, "who": by.id, "by": "lies", "page": "lies"}

    async def refusal(self, message: Any) -> str:
        with pytest.raises(NotAdmitted) as why:
            await self.orders.admit("ocelot", message)
        return str(why.value)


async def test_the_signer_gave_it_whatever_the_node_states() -> None:
    agent = Agent()
    found = await agent.orders.admit("ocelot", agent.signed())
    assert found == {
        "kind": "pause",
        "fence": 3,
        "id": "p1",
        "by": "Ann",
        "who": ANN.id,
        "page": PAGE,
        "person": None,
        "supervisors": None,
        "duties": None,
        "listed": None,
        "console": False,
        "replaying": None,
    }
    assert agent.log == [("Ann", f"First order of Ann, whose device has the key {short(ANN.id)}.")]
    await agent.orders.admit("ocelot", agent.signed())
    assert len(agent.log) == 1


async def test_who_is_on_duty_is_who_was_signed_and_not_who_the_node_or_the_command_names() -> None:
    agent = Agent()
    command_text = {"kind": "pause", "person": {"name": "C. D.", "role": "supervisor"}}
    named = {"name": "A. K.", "role": "operator"}
    message = agent.signed()
    challenge = agent.orders.challenge()
    message["signed"] = ANN.sign(command_text, vehicle="ocelot", by="Ann", challenge=challenge, page=PAGE, person=named)
    stated = {
        "person": {"name": "M. R.", "role": "supervisor", "device": "d1"},
        "supervisors": ["J. D."],
        "duties": {"J. D.": None},
        "listed": 1,
    }
    found = await agent.orders.admit("ocelot", message | stated)
    assert found["person"] == {"name": "A. K.", "role": "operator", "device": "d1"}
    assert found["supervisors"] == ["J. D."]
    assert found["duties"] == {"J. D.": None}, "as the node states; it grants no right"
    assert found["listed"] == 1
    message = agent.signed() | stated  # signed where nobody is on duty
    assert (await agent.orders.admit("ocelot", message))["person"] is None


async def test_an_order_in_the_name_of_another_device_is_refused_and_logged() -> None:
    agent = Agent()
    assert await agent.refusal({**agent.signed(BEN), "who": ANN.id}) == FORGED
    foreign = agent.signed(BEN)
    foreign["signed"] = {**foreign["signed"], "key": agent.signed(ANN)["signed"]["key"]}
    assert await agent.refusal({**foreign, "who": ANN.id}) == FORGED
    assert agent.log == [("lies", f"{FORGED} A web node passed it on.")], "at most one in 10 s"
    agent.now_s += 10
    await agent.refusal({**foreign, "who": ANN.id})
    assert len(agent.log) == 2


@pytest.mark.parametrize(
    "signed",
    [
        {},
        "x",
        {"text": "{}", "key": "", "signature": ""},
        {"text": "{}", "key": "QUJD", "signature": "QUJD"},
        {"text": "{}", "key": "é", "signature": "AAAA"},
        {"text": "{}", "key": "A" * 88, "signature": "A" * 86 + "=="},
    ],
)
async def test_what_is_no_signature_is_refused(signed: Any) -> None:
    agent = Agent()
    assert await agent.refusal({**agent.signed(), "signed": signed}) == FORGED


async def test_no_letter_of_an_order_may_be_another() -> None:
    agent = Agent()
    message = agent.signed(kind="release", number=4)
    altered = {**message["signed"], "text": message["signed"]["text"].replace('"number":4', '"number":5')}
    assert altered != message["signed"]
    assert await agent.refusal({**message, "signed": altered}) == FORGED
    assert await agent.refusal({**message, "kind": "arm"}) == ALTERED
    assert (await agent.orders.admit("ocelot", {**message, "number": 5}))["number"] == 4, "what is signed counts"
    assert await agent.refusal(agent.signed(vehicle="margay")) == OTHER_CAR


async def test_a_signed_text_that_is_no_order_is_refused() -> None:
    agent = Agent()
    for text in ("[]", "{}", '{"command":{"kind":"pause"}}', "\x00"):
        assert await agent.refusal({**agent.signed(), "signed": ANN.sign_text(text)}) == FORGED


async def test_an_order_counts_once_and_only_for_a_while() -> None:
    agent = Agent()
    message = agent.signed()
    await agent.orders.admit("ocelot", message)
    assert await agent.refusal(message) == REPLAYED
    agent.now_s += LIVES_S
    assert await agent.refusal(message) == REPLAYED, "for as long as its challenge lives"
    agent.now_s += 0.1
    assert await agent.refusal(message) == TOO_OLD
    assert await Agent().refusal(agent.signed()) == TOO_OLD, "of another run"
    for challenge in ("", "12", "zz.0", "ff.é", "0.0"):
        made = ANN.sign({"kind": "pause"}, vehicle="ocelot", by="Ann", challenge=challenge)
        assert await agent.refusal({**message, "signed": made}) == TOO_OLD, challenge


async def test_the_memory_of_orders_is_bounded_and_one_device_takes_no_room_of_another() -> None:
    agent = Agent()
    for number in range(MOST_OF_ONE):
        agent.orders._remember(f"order {ANN.id}", bytes(number))
    assert await agent.refusal(agent.signed()) == TOO_MANY
    await agent.orders.admit("ocelot", agent.signed(BEN))
    for device in range(MOST_REMEMBERED // ALWAYS_OF_ONE):  # as a node can make them up
        for number in range(ALWAYS_OF_ONE):
            agent.orders._remember(f"k{device}", bytes(number))
    with pytest.raises(NotAdmitted, match=TOO_MANY):
        agent.orders._remember("k0", b"one more")
    for _ in range(ALWAYS_OF_ONE - 1):
        await agent.orders.admit("ocelot", agent.signed(BEN))
    assert await agent.refusal(agent.signed(BEN)) == TOO_MANY
    agent.now_s += LIVES_S + 0.1
    await agent.orders.admit("ocelot", agent.signed())
    assert (len(agent.orders._seen), agent.orders._of_sender) == (1, {f"order {ANN.id}": 1})


async def test_the_name_that_a_node_gives_is_one_short_line_in_the_log() -> None:
    agent = Agent()
    assert await agent.refusal({**agent.signed(BEN), "who": ANN.id, "by": "x\n\u202e" * 2000}) == FORGED
    assert await agent.refusal({**agent.signed(BEN), "who": ANN.id, "by": ["x"]}) == FORGED
    assert [by for by, _ in agent.log] == [("x " * 20).strip()]


async def test_what_is_not_signed_is_refused_or_shown_as_that() -> None:
    agent = Agent()
    plain = {"kind": "pause", "by": "Ann", "who": ANN.id, "page": PAGE, "console": True}
    assert await agent.refusal(plain) == NOT_SIGNED
    await agent.orders.admit("ocelot", agent.signed())
    lax = Agent(required=False)
    found = await lax.orders.admit("ocelot", plain)
    assert (found["by"], found["who"], found["console"]) == ("Ann (not signed)", f"web:{ANN.id}", False)
    found = await lax.orders.admit("ocelot", plain | {"by": "x" * 60})
    assert found["by"] == "x" * 27 + " (not signed)", "the mark is never cut off"
    local = await lax.orders.admit("ocelot", {**plain, "who": "local"})
    assert local["who"] == "web:local", "nobody of this machine"


async def test_a_status_is_believed_and_needs_no_signature() -> None:
    agent = Agent()
    await agent.orders.admit("ocelot", agent.signed())
    status = {"kind": "present", "by": "Mallory", "who": ANN.id, "console": True}
    assert await agent.orders.admit("ocelot", status) == {**status, "by": "Ann", "console": False}
    for kind in ("state", "announces", "position"):
        assert (await agent.orders.admit("ocelot", {"kind": kind, "by": "Ann", "who": "local"}))["who"] == "web:local"


def test_pages_and_agents_agree_on_what_needs_no_signature() -> None:
    """What a page signs has its arguments in the signed text alone: an agent that reads none of it refuses it."""
    text = (PROJECT / "static" / "js" / "core" / "signer.js").read_text(encoding="utf-8")
    (kinds,) = re.findall(r"NO_ORDERS = new Set\(\[([^]]*)\]\)", text)
    (kept,) = re.findall(r"KEPT = /(.*)/;", text)
    assert set(re.findall(r"'(\w+)'", kinds)) == kinds_of("none") | {"replay"}  # which is of the node alone
    assert {kind for kind in commands.BY_KIND if re.search(kept, kind)} == kinds_of("wanted")


def kinds_of(signature: str) -> set[str]:
    return {kind for kind, command in commands.BY_KIND.items() if command.signature == signature}


async def test_a_mark_is_of_who_signed_it_and_any_other_is_kept_as_not_signed() -> None:
    agent = Agent()
    plain = {"mark": "m1", "words": "wet", "page": PAGE}
    signed = agent.signed(kind="mark", **plain) | plain | {"person": {"name": "M. R.", "role": "operator"}}
    altered = signed | {"words": "dry"}
    found = await agent.orders.admit("ocelot", altered)
    assert (found["by"], found["who"], found["words"]) == ("Ann", ANN.id, "wet"), "what was signed counts"
    lies = [
        signed,  # sent a second time
        signed | {"signed": None},
        signed | {"signed": agent.signed(BEN, kind="mark", **plain)["signed"]},
        signed | {"signed": agent.signed(vehicle="margay", kind="mark", **plain)["signed"]},
    ]
    for lie in lies:
        found = await agent.orders.admit("ocelot", lie)
        assert (found["by"], found["who"], found["person"]) == ("lies (not signed)", f"web:{ANN.id}", None)
        assert found["mark"] == "m1", "none is lost"
        assert "signed" not in found
    assert [text for _, text in agent.log if "not carried out" in text] == []


async def test_many_marks_at_once_leave_the_orders_of_their_device_room() -> None:
    agent = Agent()
    names = [
        (await agent.orders.admit("ocelot", agent.signed(kind="mark", mark=f"m{n}")))["by"]
        for n in range(MOST_OF_ONE + 1)
    ]
    assert names == ["Ann"] * MOST_OF_ONE + ["lies (not signed)"]
    assert (await agent.orders.admit("ocelot", agent.signed()))["by"] == "Ann"


async def test_a_name_belongs_to_the_key_that_used_it_first(tmp_path: Path) -> None:
    agent = Agent(tmp_path)
    await agent.orders.admit("ocelot", agent.signed())
    for again in (agent, Agent(tmp_path)):  # also after a restart
        found = await again.orders.admit("ocelot", again.signed(BEN))
        assert found["by"] == f"Ann · {short(BEN.id)}"
    assert [by for by, _ in agent.log] == ["Ann", f"Ann · {short(BEN.id)}"]
    assert "a name that another key has" in agent.log[1][1]
    assert (await agent.orders.admit("ocelot", agent.signed(BEN, name="Ben")))["by"] == "Ben"
    assert agent.log[2][1].endswith("is called Ben from now on.")


async def test_an_order_that_is_refused_changes_no_name(tmp_path: Path) -> None:
    agent = Agent(tmp_path)
    first, second = agent.signed(), agent.signed(name="Anna")
    for message in (first, second):
        await agent.orders.admit("ocelot", message)
    agent.now_s += 5
    written = (tmp_path / FILE).stat().st_mtime_ns
    agent.log.clear()
    assert await agent.refusal(first) == REPLAYED
    agent.orders._keys._renamed_ms.clear()
    assert await agent.refusal(first) == REPLAYED
    assert [text for _, text in agent.log] == [f"{REPLAYED} A web node passed it on."]
    assert (await agent.orders.admit("ocelot", agent.signed(name="Anna")))["by"] == "Anna"
    assert (tmp_path / FILE).stat().st_mtime_ns == written


async def test_a_device_is_called_otherwise_once_a_minute_at_most() -> None:
    agent = Agent()
    for name, called in (("Ann", "Ann"), ("A", "A"), ("B", "A"), ("C", "A")):
        assert (await agent.orders.admit("ocelot", agent.signed(name=name)))["by"] == called
    assert len(agent.log) == 2
    agent.now_s += 60
    assert (await agent.orders.admit("ocelot", agent.signed(name="C")))["by"] == "C"


def test_one_write_of_the_keys_waits_at_most(tmp_path: Path) -> None:
    storage, go_on = StorageThread(), Event()
    storage.submit(lambda: (go_on.wait(10), None)[1])
    keys = OrderKeys(tmp_path, storage=storage)
    for number in range(20):
        keys.name(f"k{number:032x}", f"phone {number}", now_ms=0)
    assert storage.waiting == 2
    go_on.set()
    storage.close()
    assert OrderKeys(tmp_path).get(f"k{19:032x}") is not None


async def test_there_is_room_for_so_many_devices() -> None:
    agent = Agent()
    for number in range(MOST):
        agent.orders._keys.name(f"k{number:032x}", f"phone {number}", now_ms=0)
    assert await agent.refusal(agent.signed()) == FULL


async def test_a_list_of_devices_lets_in_no_other(tmp_path: Path) -> None:
    listed = tmp_path / "known"
    listed.write_text(f"# the crew\n\n{ANN.id} Ann of the list\n")
    agent = Agent(known=listed)
    found = await agent.orders.admit("ocelot", agent.signed(name="Somebody"))
    assert (found["by"], agent.log) == ("Ann of the list", [])
    assert BEN.id in await agent.refusal(agent.signed(BEN))
    listed.write_text(f"{ANN.id} Ann\n{BEN.id} Ben\n")
    await agent.refusal(agent.signed(BEN))
    agent.now_s += 1
    assert (await agent.orders.admit("ocelot", agent.signed(BEN)))["by"] == "Ben", "read anew"


@pytest.mark.parametrize("storage", [StorageThread, lambda: None])
async def test_a_device_that_was_taken_out_of_the_list_orders_nothing(tmp_path: Path, storage: Any) -> None:
    listed = tmp_path / "known"
    listed.write_text(f"{ANN.id} Ann\n{BEN.id} Ben\n")
    disk = storage()
    agent = Agent(known=listed, storage=disk)
    await agent.orders.admit("ocelot", agent.signed())
    listed.write_text(f"{BEN.id} Ben\n")
    await agent.orders.admit("ocelot", agent.signed())  # it is looked at once a second
    agent.now_s += 1
    message = agent.signed()
    if disk is not None:
        await disk.run(lambda: None)
    assert ANN.id in await agent.refusal(message)
    await agent.orders.admit("ocelot", agent.signed(BEN))
    listed.write_text("no list any more")
    agent.now_s += 1
    agent.orders.challenge()
    if disk is not None:
        disk.close()
    await agent.orders.admit("ocelot", agent.signed(BEN))
    agent.now_s += 1
    agent.orders.challenge()  # without a disk


@pytest.mark.parametrize(
    "text",
    [
        pytest.param("x\n", id="no key"),
        pytest.param(f"{ANN.id}\n", id="no name"),
        pytest.param(f"{ANN.id} Ann\n{ANN.id} Ben", id="one key twice"),
        pytest.param(f"{ANN.id} A\n{BEN.id} A", id="one name twice"),
    ],
)
def test_a_list_that_cannot_be_used_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / "known").write_text(text)
    with pytest.raises(BadList, match="known"):
        read_list(tmp_path / "known")
    with pytest.raises(BadList, match="cannot be read"):
        read_list(tmp_path / "none")


async def test_a_long_argument_is_signed_by_its_hash() -> None:
    agent = Agent()
    digest = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"  # of nothing

    def sent(toml: str) -> Any:
        challenge = agent.orders.challenge()
        signed = ANN.sign({"kind": "import"}, vehicle="ocelot", by="Ann", challenge=challenge, hashes={"toml": digest})
        return {"kind": "import", "toml": toml, "signed": signed}

    assert await agent.refusal(sent("a = 1")) == ALTERED
    assert agent.orders._keys.get(ANN.id) is None, "what is refused names no device"
    assert (await agent.orders.admit("ocelot", sent("")))["toml"] == ""


async def test_the_moment_of_a_press_is_by_the_clock_of_the_agent() -> None:
    agent = Agent()
    message = agent.signed(kind="slow_down", heard_ms=5.0)
    agent.now_s += 0.2
    found = await agent.orders.admit("ocelot", message)
    assert found["heard_ms"] == pytest.approx(1_000_000, abs=2)


@pytest.mark.field
async def test_it_takes_no_time() -> None:
    agent = Agent()
    messages = [agent.signed() for _ in range(50)]
    began_s = time.perf_counter()
    for message in messages:
        await agent.orders.admit("ocelot", message)
    each_s = (time.perf_counter() - began_s) / len(messages)
    print(f"{each_s * 1000:.3f} ms an order")
    assert each_s < 0.005
