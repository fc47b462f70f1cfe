"""How a program connects to its broker again."""

from __future__ import annotations

from pathlib import Path

import psutil
import pytest

from server.bus import nats_link
from server.bus.broker import Broker as BrokerAddress
from server.bus.nats_bus import NatsBus
from server.bus.nats_link import BrokerLink
from tests.server.bus.broker import running_broker
from tests.server.bus.buses import until
from tests.server.bus.test_orders_held import freeze
from tests.server.mail.post import certificates


async def test_over_tls_a_broker_that_does_not_answer_is_dialled_again_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As behind a gap of the radio: nothing waits for a last reply of the lost connection."""
    authority = tmp_path / "ca.pem"
    text, server_pem = certificates(tmp_path)
    authority.write_text(text)
    (tmp_path / "tls.conf").write_text(f'tls {{cert_file: "{server_pem}", key_file: "{server_pem}"}}\n')
    async with running_broker(include=tmp_path / "tls.conf") as broker:

        def ports() -> set[int]:
            """Ours of the connections to the broker."""
            made = psutil.Process().net_connections("tcp")
            ours = (one for one in made if one.raddr and one.raddr.port == broker.port)
            return {int(one.laddr.port) for one in ours if one.status == psutil.CONN_ESTABLISHED}

        address = BrokerAddress(address=broker.address.replace("nats:", "tls:"), authority=authority)
        link = BrokerLink(address, NatsBus(now=lambda: 0.0), name="test")
        link.start()
        try:
            await until(lambda: link.complaint is None)
            before = ports()
            freeze(broker.pid)
            monkeypatch.setattr(nats_link, "PING_ANSWERED_WITHIN_S", 1)
            assert not before & await until(lambda: (now := ports()) and not now & before and now)
        finally:
            await link.stop()
