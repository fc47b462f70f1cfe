"""Invitations, attempts, tickets, cookies, keys and names, each by itself; time is an argument."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from server.access import invitations, secret_file
from server.access.credentials import BadKey, Cookies, Tickets, keys_from, keys_of
from server.access.identity import Role
from server.access.invitations import FEW, LASTS_S, MANY, MOST_STANDING, Invitations, PinThrottle
from server.access.names import Names
from server.app.config import Config
from server.system.loopback import is_loopback
from tests.server.access.pairs import access_of, config

DAY_MS = 86_400_000


# -- invitations -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("later_s", "is_in"), [(0.0, True), (LASTS_S - 0.001, True), (LASTS_S, False)])
def test_an_invitation_lasts_ten_minutes(later_s: float, is_in: bool) -> None:
    all_of = Invitations()
    made = all_of.new(Role.VIEWER, now_s=100.0)
    assert (all_of.take(token=made.token, now_s=100.0 + later_s) is not None) is is_in


def test_token_and_pin_are_used_up_together_and_by_nothing_else() -> None:
    all_of = Invitations()
    one, two = all_of.new(Role.VIEWER, now_s=0.0), all_of.new(Role.OPERATOR, now_s=0.0)
    assert one.pin != two.pin
    for wrong in ("", one.token[:-1], one.token + "x", one.pin, "\udcff"):
        assert all_of.take(token=wrong, now_s=1.0) is None
    assert all_of.take(pin=one.token, now_s=1.0) is None
    assert all_of.take(pin=one.pin, now_s=1.0) is one
    assert all_of.take(token=one.token, now_s=1.0) is None
    assert all_of.take(token=two.token, now_s=1.0) is two


def test_few_pins_stand_at_once() -> None:
    all_of = Invitations()
    made = [all_of.new(Role.VIEWER, now_s=float(n)) for n in range(MOST_STANDING + 3)]
    assert all_of.standing(10.0) == made[3:]


async def test_the_terminal_shows_the_same_until_it_is_used_or_old() -> None:
    now_s = 0.0
    access = access_of(config(), now=lambda: now_s, wall_ms=lambda: 0)
    paired: list[tuple[str, Role]] = []
    access.on_paired = lambda name, role: paired.append((name, role))
    first = access.invitation()
    assert (access.invitation().token, access.invitation().pin) == (first.token, first.pin)
    await access.pair(token=first.token, pin=None, name="Pixel", peer="10.0.0.9")
    assert paired == [("Pixel", Role.OPERATOR)]
    second = access.invitation()
    assert second.token != first.token
    now_s = LASTS_S
    assert access.invitation().token != second.token


# -- attempts ----------------------------------------------------------------------------------------------------------


def test_waits_grow_with_wrong_pins_and_expire() -> None:
    throttle = PinThrottle()
    now_s, waits = 0.0, []
    for _ in range(12):
        throttle.wrong("10.0.0.9", now_s=now_s)
        waits.append(throttle.wait_s("10.0.0.9", now_s=now_s))
        now_s += waits[-1]
    assert waits[:FEW] == [0.0, 0.0, 2.0]
    assert waits[FEW:8] == [4.0, 8.0, 16.0, 32.0, 64.0]
    assert max(waits) == 300.0
    assert throttle.wait_s("10.0.0.8", now_s=now_s - waits[-1]) <= 30.0
    throttle.wrong("10.0.0.9", now_s=now_s + 901.0)
    assert throttle.wait_s("10.0.0.9", now_s=now_s + 901.0) == 0.0


def test_many_peers_together_wait_as_one_and_get_thirty_tries_a_pin() -> None:
    throttle, now_s, tries = PinThrottle(), 0.0, 0
    while now_s < LASTS_S:
        peer = f"2001:db8:{tries:x}::"
        wait_s = throttle.wait_s(peer, now_s=now_s)
        if wait_s > 0:
            now_s += wait_s
            continue
        throttle.wrong(peer, now_s=now_s)
        tries += 1
    assert MANY < tries <= 36


def test_a_right_pin_forgives_its_peer_only() -> None:
    throttle = PinThrottle()
    for _ in range(MANY + 2):
        throttle.wrong("10.0.0.9", now_s=0.0)
    throttle.right("10.0.0.9")
    assert throttle.wait_s("10.0.0.9", now_s=0.0) == throttle.wait_s("10.0.0.8", now_s=0.0) == 8.0


def test_peers_are_forgotten_before_they_are_too_many() -> None:
    throttle = PinThrottle()
    for n in range(1500):
        throttle.wrong(str(n), now_s=0.0)
    assert len(throttle._peers) == 1000


@pytest.mark.parametrize(
    ("one", "other", "is_same"),
    [
        ("2001:db8::1", "2001:db8::ffff", True),
        ("2001:db8::1", "2001:db8:0:1::1", False),
        ("::ffff:10.0.0.9", "10.0.0.9", True),
        ("10.0.0.9", "10.0.0.8", False),
        ("fe80::1%eth0", "fe80::2%eth1", True),
    ],
)
def test_a_network_of_ipv6_counts_as_one_peer(one: str, other: str, is_same: bool) -> None:
    from server.access.access import _peer

    assert (_peer(one) == _peer(other)) is is_same


# -- tickets -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("later_s", "is_in"), [(4.999, True), (5.0, False), (60.0, False)])
def test_a_ticket_lasts_five_seconds(later_s: float, is_in: bool) -> None:
    tickets = Tickets()
    assert tickets.use(tickets.new("a", now_s=1.0), "a", now_s=1.0 + later_s) is is_in


@pytest.mark.parametrize(("away_s", "is_in"), [(0.0, True), (599.0, True), (601.0, False)])
def test_a_ticket_of_a_socket_lasts_ten_minutes_beyond_it(away_s: float, is_in: bool) -> None:
    tickets, times = Tickets(), iter((0.0, 50_000.0))
    with tickets.beside_socket("a", now=lambda: next(times)) as ticket:
        tickets.new("b", now_s=49_000.0)
    assert tickets.use(ticket, "a", now_s=50_000.0 + away_s) is is_in


def test_a_ticket_of_a_second_socket_lasts_while_the_first_one_is_served() -> None:
    tickets, now_s = Tickets(), [0.0]
    with tickets.beside_socket("a", now=lambda: now_s[0]) as first:
        assert tickets.use(first, "a", now_s=0.0)
        with tickets.beside_socket("a", now=lambda: now_s[0]) as second:
            pass
        now_s[0] = 50_000.0
        tickets.new("b", now_s=now_s[0])
        assert second in tickets._open
    tickets.new("b", now_s=50_599.0)
    assert second in tickets._open
    assert not tickets.use(second, "a", now_s=50_601.0)
    assert not tickets._served
    assert not tickets._left


def test_of_sockets_that_end_beside_another_one_few_tickets_are_kept() -> None:
    tickets = Tickets()
    with tickets.beside_socket("a", now=lambda: 0.0) as own:
        left = []
        for _ in range(50):
            with tickets.beside_socket("a", now=lambda: 0.0) as ticket:
                left.append(ticket)
        tickets.new("b", now_s=700.0)
        assert [one for one in (own, *left) if one in tickets._open] == [own, *left[-4:]]


def test_a_ticket_of_a_socket_that_was_used_meanwhile_stays_used() -> None:
    tickets = Tickets()
    with tickets.beside_socket("a", now=lambda: 0.0) as ticket:
        assert tickets.use(ticket, "a", now_s=0.0)
    assert not tickets.use(ticket, "a", now_s=0.0)


def test_a_ticket_is_used_up_by_whoever_shows_it() -> None:
    tickets = Tickets()
    mine, other = tickets.new("a", now_s=0.0), tickets.new("a", now_s=0.0)
    assert not tickets.use(mine, "b", now_s=0.0)
    assert not tickets.use(mine, "a", now_s=0.0)
    assert not tickets.use("", "", now_s=0.0)
    assert tickets.use(other, "a", now_s=0.0)
    for n in range(3000):
        tickets.new(str(n), now_s=0.0)
    assert len(tickets._open) == 2000


# -- cookies -----------------------------------------------------------------------------------------------------------


def test_a_cookie_is_read_for_ninety_days_and_renewed_after_one() -> None:
    now_ms = 1_790_000_000_000
    cookies = Cookies("k" * 64, "0badcafe", wall_ms=lambda: now_ms)
    given = cookies.header("id", "secret:with:colons", is_secure=False)
    sent = f"theme=dark; {given.partition(';')[0]}; other=1"
    assert cookies.read(sent, is_secure=False) == ("id", "secret:with:colons", False)
    assert cookies.read(sent, is_secure=True) is None  # under TLS only the name that TLS protects
    now_ms += DAY_MS + 1000
    assert cookies.read(sent, is_secure=False) == ("id", "secret:with:colons", True)
    now_ms += 89 * DAY_MS
    assert cookies.read(sent, is_secure=False) is None
    now_ms -= 200 * DAY_MS  # the clock of a server without a battery
    assert cookies.read(sent, is_secure=False) is None
    assert Cookies("l" * 64, "0badcafe", wall_ms=lambda: 1_790_000_000_000).read(sent, is_secure=False) is None


def test_under_tls_the_cookie_is_bound_to_this_host() -> None:
    cookies = Cookies("k" * 64, "0badcafe", wall_ms=lambda: 0)
    given = cookies.header("id", "secret", is_secure=True)
    assert given.startswith("__Host-catgraph-0badcafe=")
    assert {"Secure", "HttpOnly", "SameSite=Strict", "Path=/"} <= set(given.split("; "))
    assert "Domain" not in given


# -- invitations of another process ------------------------------------------------------------------------------------


def test_an_invitation_laid_into_the_folder_is_taken_once_and_grows_old(tmp_path: Path) -> None:
    laid = invitations.lay_invitation(tmp_path, Role.VIEWER, wall_ms=1_000_000)
    found = invitations.collect_invitations(tmp_path, now_s=50.0, wall_ms=1_060_000)
    assert [(one.token, one.pin, one.role, one.until_s) for one in found] == [
        (laid.token, laid.pin, Role.VIEWER, 590.0)
    ]
    assert invitations.collect_invitations(tmp_path, now_s=50.0, wall_ms=1_060_000) == []
    invitations.lay_invitation(tmp_path, Role.VIEWER, wall_ms=1_000_000)
    assert invitations.collect_invitations(tmp_path, now_s=50.0, wall_ms=1_600_000) == []
    invitations.lay_invitation(tmp_path, Role.VIEWER, wall_ms=9_000_000)  # from the future: ten minutes, not more
    assert invitations.collect_invitations(tmp_path, now_s=50.0, wall_ms=1_600_000)[0].until_s == 650.0
    (tmp_path / "waiting" / "x.json").write_text('{"token": "short", "pin": "1"}')
    assert invitations.collect_invitations(tmp_path, now_s=50.0, wall_ms=0) == []
    assert list((tmp_path / "waiting").iterdir()) == []


def test_a_server_that_ended_is_not_found(tmp_path: Path) -> None:
    assert invitations.running_server(tmp_path) is None
    invitations.announce_server(tmp_path, "https://192.168.4.1:8000/")
    assert invitations.running_server(tmp_path) == "https://192.168.4.1:8000/"
    secret_file.write(tmp_path / "running.json", {"pid": 2**22 + 1, "address": "https://x/"})
    assert invitations.running_server(tmp_path) is None
    invitations.announce_server(tmp_path, "https://x/")
    invitations.retire_server(tmp_path)
    assert invitations.running_server(tmp_path) is None


# -- keys --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "keys",
    [{Role.OPERATOR: "short"}, {Role.OPERATOR: "ä" * 30}, {Role.OPERATOR: "x " * 20}, {Role.OPERATOR: "x" * 600}],
)
def test_a_weak_key_is_refused_and_not_printed(keys: dict[Role, str]) -> None:
    with pytest.raises(BadKey) as why:
        keys_of(keys)
    assert keys[Role.OPERATOR] not in str(why.value)


def test_keys_come_from_the_environment_or_from_files_for_one_user(tmp_path: Path) -> None:
    path = tmp_path / "key"
    path.write_text("a-key-from-a-file-of-its-own\n")
    path.chmod(0o640)
    with pytest.raises(BadKey, match="chmod 600"):
        keys_from({"CATGRAPH_KEY_FILE": str(path)})
    path.chmod(0o600)
    keys = keys_from({"CATGRAPH_KEY_FILE": str(path), "CATGRAPH_VIEWER_KEY": "v" * 20})
    who = keys.who("bearer a-key-from-a-file-of-its-own")
    assert who is not None
    assert (who.role, who.is_program, who.id) == (Role.OPERATOR, True, "key-operator")
    assert keys.who("Bearer " + "v" * 20).role is Role.VIEWER  # type: ignore[union-attr]
    assert "a-key" not in repr(keys)
    assert "a-key" not in repr(Config(keys=keys))
    with pytest.raises(BadKey, match="cannot be read"):
        keys_from({"CATGRAPH_KEY_FILE": str(tmp_path / "none")})
    with pytest.raises(BadKey, match="the same"):
        keys_from({"CATGRAPH_KEY": "k" * 20, "CATGRAPH_VIEWER_KEY": "k" * 20})
    assert keys_from({}).who("Bearer ") is None


# -- names -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("host", "is_own"),
    [
        *((own, True) for own in ("127.0.0.1", "127.8.9.1", "::1", "localhost", "LOCALHOST", "::ffff:127.0.0.1")),
        *(
            (far, False)
            for far in ("0.0.0.0", "::", "192.168.4.1", "", "localhost.example", "127.1", "car", "fe80::1%eth0")
        ),
    ],
)
def test_what_is_this_machine_alone(host: str, is_own: bool) -> None:
    assert is_loopback(host) is is_own
    assert Config(host=host).is_open is is_own


def test_a_new_address_of_the_machine_is_found_and_queried_seldom() -> None:
    now_s, addresses, looked = 0.0, {"192.168.4.1"}, 0

    def look_up() -> frozenset[str]:
        nonlocal looked
        looked += 1
        return frozenset(addresses)

    names = Names(["ocu.example.org"], is_open=False, now=lambda: now_s, addresses=look_up, in_container=False)
    assert names.knows("192.168.4.1:8000")
    assert names.knows("ocu.example.org")
    assert not names.knows("192.168.4.2:8000")
    addresses.add("192.168.4.2")
    assert not names.knows("192.168.4.2:8000")
    assert looked == 1
    now_s = 2.0
    assert names.knows("192.168.4.2:8000")
    assert not names.knows("x.ocu.example.org")


@pytest.mark.parametrize(
    ("host", "is_taken"),
    [
        ("192.168.4.9:8000", True),
        ("[fd00::9]:8000", True),
        ("100.64.0.9", True),
        ("8.8.8.8", False),
        ("[2001:db8::9]", False),
        ("car.example", False),
        ("192.168.4.9.example", False),
    ],
)
def test_in_a_container_the_machine_around_it_may_have_any_private_address(host: str, is_taken: bool) -> None:
    nothing = frozenset[str]()
    inside = Names([], is_open=False, addresses=lambda: nothing, in_container=True)
    assert inside.knows(host) is is_taken
    assert not Names([], is_open=False, addresses=lambda: nothing, in_container=False).knows(host)
    assert not Names([], is_open=True, addresses=lambda: nothing, in_container=True).knows(host)


def test_behind_a_proxy_the_origin_is_the_proxys() -> None:
    names = Names(["https://ocu.example.org/", "http://plain.example:8080"], is_open=True)
    assert names.knows("ocu.example.org")
    assert names.may_ask("https://ocu.example.org", scheme="http", host="ocu.example.org")
    assert not names.may_ask("https://ocu.example.org", scheme="http", host="localhost")
    assert not names.may_ask("https://ocu.example.org.evil.example", scheme="http", host="ocu.example.org")
    assert names.is_behind_tls("OCU.example.org")
    assert not names.is_behind_tls("plain.example:8080")
    assert not names.may_ask("", scheme="http", host="x")


@pytest.mark.parametrize(
    "name", ["", "a b", "ftp://x", "https://x/path", "https://u@x", "*.example.org", "x:y", "http://"]
)
def test_what_is_no_name_is_refused_before_it_serves(name: str) -> None:
    with pytest.raises(ValueError, match="is no name"):
        Names([name], is_open=False)


def test_the_odds_of_a_guess_are_as_they_are_told() -> None:
    """36 tries at most in the life of a PIN, six PINs at most at once."""
    assert math.isclose(36 * MOST_STANDING / 10**6, 2.16e-4)
