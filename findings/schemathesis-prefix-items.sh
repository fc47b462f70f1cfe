#!/bin/sh
# schemathesis 4.32.5 (PyPI), OpenAPI 3.1.
#
# What a good engineer would guess: an answer whose description uses `prefixItems` (JSON Schema 2020-12, the dialect of
# OpenAPI 3.1) is checked against it. FastAPI describes a Python tuple so.
#
# What is seen: schemathesis rewrites `prefixItems` to a list under `items`, the form of older drafts, and then refuses
# the description: a list "is not of types 'boolean', 'object'". The valid description is reported as a failure of the
# server, and the answer itself is not checked. With the same description but `items: {"type": "number"}` it passes.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 2
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check schemathesis==4.32.5 || exit 2

cat > "$folder/try.py" <<'PYTHON'
import json
import subprocess
import sys
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer
from importlib.metadata import version
from pathlib import Path

PAIR = {"type": "array", "prefixItems": [{"type": "integer"}, {"type": "number"}], "minItems": 2, "maxItems": 2}
LIST = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}


class Server(BaseHTTPRequestHandler):
    schema: dict = {}

    def do_GET(self):
        answer = [1, 2.5]
        if self.path == "/openapi.json":
            content = {"application/json": {"schema": self.schema}}
            answer = {
                "openapi": "3.1.0",
                "info": {"title": "pair", "version": "1"},
                "paths": {"/pair": {"get": {"responses": {"200": {"description": "a pair", "content": content}}}}},
            }
        body = json.dumps(answer).encode()
        self.send_response(200)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_):
        pass


def tried(schema):
    """The exit code of schemathesis, and what it printed."""
    server = HTTPServer(("127.0.0.1", 0), type("Described", (Server,), {"schema": schema}))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    program = [str(Path(sys.executable).with_name("schemathesis")), "run", "--no-color"]
    options = ["--checks", "response_schema_conformance", "--phases", "fuzzing", "--max-examples", "1"]
    address = f"http://127.0.0.1:{server.server_port}/openapi.json"
    done = subprocess.run([*program, address, *options], capture_output=True, text=True)
    server.shutdown()
    return done.returncode, done.stdout + done.stderr


print(f"schemathesis {version('schemathesis')}")
pair, printed = tried(PAIR)
plain, _ = tried(LIST)
line = next((one.strip() for one in printed.splitlines() if "is not of types" in one), "no such line")
print(f"  with prefixItems: exit {pair}, {line}")
print(f"  with items: exit {plain}")
holds = pair == 1 and plain == 0 and "is not of types" in printed
print("The behaviour holds." if holds else "The behaviour has changed.")
sys.exit(0 if holds else 1)
PYTHON

status=0
"$folder/venv/bin/python" "$folder/try.py" || status=$?
exit "$status"
