"""How a program connects to its broker again."""

from __future__ import annotations

from pathlib import Path

import psutil

from server.bus.broker import Broker as BrokerAddress
from server.bus.nats_bus import NatsBus
from server.bus.nats_link import BrokerLink
from tests.server.bus.broker import running_broker
from tests.server.bus.buses import until
from tests.server.bus.test_orders_held import freeze
from tests.server.mail.post import certificates


async def test_over_tls_a_broker_that_does_not_answer_is_dialled_again_at_once(tmp_path: Path) -> None:
    """As behind a gap of the radio: nothing waits for a last reply of the lost connection."""
    authority = tmp_path / "ca.pem"
    text, server_pem = certificates(tmp_path)
    authority.write_text(text)
    (tmp_path / "tls.conf").write_text(f'tls {{cert_file: "{server_pem}", key_file: "{server_pem}"}}\n')
    async with running_broker(include=tmp_path / "tls.conf") as broker:

        def port() -> int | None:
            """Ours of the connection to the broker."""
            for one in psutil.Process().net_connections("tcp"):
                if one.raddr and one.raddr.port == broker.port and one.status == psutil.CONN_ESTABLISHED:
                    return int(one.laddr.port)
            return None

        address = BrokerAddress(address=broker.address.replace("nats:", "tls:"), authority=authority)
        link = BrokerLink(address, NatsBus(now=lambda: 0.0), name="test")
        link.start()
        try:
            await until(lambda: link.complaint is None)
            before = port()
            freeze(broker.pid)
            assert link._client is not None
            await link._client.force_reconnect()
            assert before != await until(lambda: (now := port()) != before and now)
        finally:
            await link.stop()
