"""A real SMTP server (aiosmtpd) as a process of its own, with the moods of one: it refuses, delays, loses its replies.

Prints its port, then keeps what it takes in a folder: a mail a file, and a line of JSON for each in `taken.jsonl`,
written before it answers, as a reliable server does.
"""

from __future__ import annotations

import argparse
import asyncio
import email
import hashlib
import json
import os
import random
import ssl
from pathlib import Path
from typing import Any

from aiosmtpd.smtp import SMTP, AuthResult, Envelope, LoginPassword, Session


class Mailbox:
    """Accepts, refuses or drops mail as configured."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.options = options
        self.folder: Path = options.folder
        self.chance = random.Random(options.seed)
        self.count = len(list(self.folder.glob("*.eml")))

    async def handle_RCPT(
        self, server: SMTP, session: Session, envelope: Envelope, address: str, options: list[str]
    ) -> str:
        if address in self.options.refuse:
            return f"550 5.1.1 <{address}>: no such mailbox"
        if address in self.options.delay:
            return f"450 4.2.0 <{address}>: greylisted, come back later"
        envelope.rcpt_tos.append(address)
        envelope.rcpt_options.extend(options)
        return "250 2.1.5 OK"

    async def handle_DATA(self, server: SMTP, session: Session, envelope: Envelope) -> str:
        mood = self.chance.random()
        if mood < self.options.temporary:
            return "451 4.3.0 try again later"
        if self.options.reject:
            return "554 5.6.0 content rejected"
        content = envelope.original_content or b""
        message = email.message_from_bytes(content)
        self.count += 1
        path = self.folder / f"{self.count:05}-{os.getpid()}.eml"
        path.write_bytes(content)
        with open(self.folder / "taken.jsonl", "a", encoding="utf-8") as file:  # noqa: ASYNC230 - nothing else waits here
            file.write(
                json.dumps(
                    {
                        "file": path.name,
                        "message_id": message["Message-ID"],
                        "date": message["Date"],
                        "to": envelope.rcpt_tos,
                        "from": envelope.mail_from,
                        "tls": bool(server.transport and server.transport.get_extra_info("sslcontext")),
                        "login": session.auth_data.login.decode() if session.auth_data else None,
                        "sha256": hashlib.sha256(content).hexdigest(),
                        "size": len(content),
                    }
                )
                + "\n"
            )
        if mood < self.options.temporary + self.options.lost:
            assert server.transport is not None
            server.transport.abort()  # accepted, but the client gets no reply
        return "250 2.0.0 OK queued as " + path.stem


def login(options: argparse.Namespace) -> Any:
    def check(server: SMTP, session: Session, envelope: Envelope, mechanism: str, data: Any) -> AuthResult:
        is_known = isinstance(data, LoginPassword) and (data.login, data.password) == (
            options.user.encode(),
            options.password.encode(),
        )
        if is_known:
            return AuthResult(success=True, auth_data=data)
        reply = f"535 5.7.8 not accepted: {data.password.decode()}"  # such servers are: the password must not be shown
        return AuthResult(success=False, handled=False, message=reply)

    return check


async def main(options: argparse.Namespace) -> None:
    options.folder.mkdir(parents=True, exist_ok=True)
    box = Mailbox(options)
    context = None
    if options.cert:
        context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
        context.load_cert_chain(options.cert)

    def serve() -> SMTP:
        return SMTP(
            box,
            hostname="mail.test",
            enable_SMTPUTF8=not options.ascii,
            data_size_limit=options.size,
            tls_context=context if options.starttls else None,
            require_starttls=options.starttls,
            auth_required=bool(options.user),
            auth_require_tls=options.starttls,
            authenticator=login(options) if options.user else None,
        )

    loop = asyncio.get_running_loop()
    server = await loop.create_server(
        serve, "127.0.0.1", options.port, ssl=context if context and not options.starttls else None, reuse_address=True
    )
    print(server.sockets[0].getsockname()[1], flush=True)
    await server.serve_forever()


def arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--port", type=int, default=0)
    parser.add_argument("--cert", help="PEM with key and certificate; TLS from the first byte")
    parser.add_argument("--starttls", action="store_true")
    parser.add_argument("--user", default="")
    parser.add_argument("--password", default="")
    parser.add_argument("--refuse", nargs="*", default=[])
    parser.add_argument("--delay", nargs="*", default=[])
    parser.add_argument("--reject", action="store_true")
    parser.add_argument("--temporary", type=float, default=0.0)
    parser.add_argument("--lost", type=float, default=0.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--size", type=int, default=33_554_432)
    parser.add_argument("--ascii", action="store_true")
    return parser


if __name__ == "__main__":
    asyncio.run(main(arguments().parse_args()))
