"""A little server of tiles as a process of its own: `python tile_server.py FOLDER [PORT]`.

FOLDER/mood.json sets how it answers now, `held` not before the mood changes. FOLDER/requests.jsonl holds the
requests: path, headers, how many at once.
Every tile is a picture of its own.
"""

from __future__ import annotations

import json
import struct
import sys
import threading
import time
import zlib
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

LOCK = threading.Lock()


def picture(path: str) -> bytes:
    """A tile of one colour, which its path selects."""
    colour = zlib.crc32(path.encode()).to_bytes(4, "big")[:3]

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", 256, 256, 8, 2, 0, 0, 0))
    rows = chunk(b"IDAT", zlib.compress((b"\x00" + colour * 256) * 256))
    return b"\x89PNG\r\n\x1a\n" + head + rows + chunk(b"IEND", b"")


class Tiles(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    at_once = 0
    folder = Path()

    def do_GET(self) -> None:
        mood: dict[str, Any] = json.loads((self.folder / "mood.json").read_text())
        with LOCK:
            Tiles.at_once += 1
            with (self.folder / "requests.jsonl").open("a") as requests:
                row = {"path": self.path, "headers": dict(self.headers), "at_once": Tiles.at_once}
                requests.write(json.dumps(row) + "\n")
        try:
            while mood.get("held"):
                time.sleep(0.02)
                mood = json.loads((self.folder / "mood.json").read_text())
            time.sleep(mood.get("after_s", 0))
            self.answer(mood)
        except OSError:
            pass  # nobody waits any more
        finally:
            with LOCK:
                Tiles.at_once -= 1

    def answer(self, mood: dict[str, Any]) -> None:
        status, body = mood.get("status", 200), picture(self.path + mood.get("edition", ""))
        if "etag" in mood and self.headers.get("If-None-Match") == mood["etag"]:
            status, body = 304, b""
        elif "body" in mood:
            body = mood["body"].encode() * mood.get("times", 1)
        self.send_response(status)
        for name, value in {"Content-Type": "image/png", **mood.get("headers", {})}.items():
            self.send_header(name, value)
        if "etag" in mood:
            self.send_header("ETag", mood["etag"])
        self.close_connection = "length" in mood  # as a link that breaks off
        self.send_header("Content-Length", str(mood.get("length", len(body))))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        pass


if __name__ == "__main__":
    Tiles.folder = Path(sys.argv[1])
    server = ThreadingHTTPServer(("127.0.0.1", int(sys.argv[2]) if len(sys.argv) > 2 else 0), Tiles)
    server.daemon_threads = True
    print(server.server_address[1], flush=True)
    server.serve_forever()
