"""HTTP on 127.0.0.1: static files, one stream of events, one address for commands.

Any page in a browser and any program on this computer can send requests here. Commands therefore need a secret, which
is only in the fragment (after #) of the page's URL; browsers do not send it. Requests with a foreign host name are
refused, because the owner of a name that resolves to 127.0.0.1 could otherwise take over our page (DNS rebinding). The
number of connections is limited; the oldest one that does not get events makes room for a new one.
"""

from __future__ import annotations

import contextlib
import math
import secrets
import socket
import sys
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from typing import Any

from ..documents import parse_json
from ..errors import BiotacError, PortError, error_text
from .reader import PageReader
from .rows import compact, facts
from .state import PageState

HOST = "127.0.0.1"
TOKEN_HEADER = "X-Biotac-Token"
EVENT_S = 1 / 60  # browsers do not draw more often
QUIET_S = 1.0  # after so long without news a comment is sent, to notice a browser that left
# Small, so that a slow browser misses rows instead of lagging by megabytes. Behind a slow line, the buffers of a
# browser and a tunnel still make it lag by seconds, and it says so: it compares when news were sent (PageState.wait).
SEND_BUFFER_BYTES = 1 << 16
SEND_TIMEOUT_S = 10.0
MAX_BODY_BYTES = 1000
MAX_CONNECTIONS = 32  # without those that get events; a browser opens six
MAX_PAGES = 16
TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}
GUARDS = {
    "Content-Security-Policy": "default-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}


class ViewServer(ThreadingHTTPServer):
    """Serves ``state`` and passes commands to ``reader``. Raises PortError when ``port`` is taken."""

    daemon_threads = True
    block_on_close = False

    def __init__(self, state: PageState, reader: PageReader, port: int) -> None:
        self.state = state
        self.reader = reader
        self.token = secrets.token_urlsafe(24)
        folder = resources.files("biotac.view").joinpath("static")
        self.files = {file.name: file.read_bytes() for file in folder.iterdir() if file.name.endswith(tuple(TYPES))}
        self._counting = threading.Lock()
        self._asking: dict[Any, None] = {}  # connections that do not get events, oldest first
        self._pages: set[Any] = set()  # connections that get events
        try:
            super().__init__((HOST, port), Handler)
        except OSError as error:
            raise PortError(
                f"cannot serve on {HOST}:{port} ({error.strerror}); use --port 0 for any free port"
            ) from error
        self.names = {f"{name}:{self.server_port}" for name in (HOST, "localhost")}

    @property
    def url(self) -> str:
        """The page's URL without the secret, for viewing only."""
        return f"http://{HOST}:{self.server_port}/"

    def process_request(self, request: Any, client_address: Any) -> None:
        """See socketserver; makes room first."""
        with self._counting:
            while len(self._asking) >= MAX_CONNECTIONS:
                oldest = next(iter(self._asking))
                del self._asking[oldest]
                with contextlib.suppress(OSError):
                    oldest.shutdown(socket.SHUT_RDWR)  # the thread then reads end of file and ends
            self._asking[request] = None
        super().process_request(request, client_address)

    def begin_page(self, request: Any) -> bool:
        """Count the connection as one that gets events; False if there are too many."""
        with self._counting:
            if len(self._pages) >= MAX_PAGES:
                return False
            self._asking.pop(request, None)
            self._pages.add(request)
            return True

    def shutdown_request(self, request: Any) -> None:
        with self._counting:
            self._asking.pop(request, None)
            self._pages.discard(request)
        super().shutdown_request(request)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore a browser that leaves in the middle of a response; anything else is our error."""
        if not isinstance(sys.exc_info()[1], (ConnectionError, TimeoutError)):
            super().handle_error(request, client_address)


class Handler(BaseHTTPRequestHandler):
    server: ViewServer
    server_version = "biotac"
    sys_version = ""
    protocol_version = "HTTP/1.1"
    timeout = SEND_TIMEOUT_S

    def do_GET(self) -> None:
        """Static files and events."""
        if not self._known_name():
            return
        name = self._file_name()
        if name == "events":
            self._events()
        elif name in self.server.files:
            self._answer(200, TYPES[name[name.rindex(".") :]], self.server.files[name])
        else:
            self._words(404, f"nothing at /{name}")

    def do_HEAD(self) -> None:
        """Answer 200 for a name that is served, 404 for any other."""
        if self._known_name():
            is_there = self._file_name() in ("events", *self.server.files)
            self._head(200 if is_there else 404, "text/html; charset=utf-8", {})

    def _file_name(self) -> str:
        return self.path.partition("?")[0].removeprefix("/") or "index.html"

    def do_POST(self) -> None:
        """Commands: ``{"do": "tare", "finger": 0}``, answered with ``{"words": ...}``."""
        self.close_connection = True  # discards the unread body of a refused request
        if not self._known_name():
            return
        if not secrets.compare_digest(self.headers.get(TOKEN_HEADER, "").encode(), self.server.token.encode()):
            self._words(403, "this page is view-only; to send commands, open the address that `biotac view` printed")
            return
        if self.path != "/command":
            self._words(404, f"nothing at {self.path}")
            return
        try:
            self._words(200, self.server.reader.ask(*parse_command(self._body())))
        except (ValueError, KeyError) as error:  # of a finger that there is not
            self._words(400, error_text(error))
        except (BiotacError, OSError) as error:
            self._words(409, str(error))

    def _body(self) -> bytes:
        length = self.headers.get("Content-Length", "")
        if not length.isascii() or not length.isdigit() or int(length) > MAX_BODY_BYTES:
            raise ValueError(f"a body of {length or 'unknown'} bytes, expected at most {MAX_BODY_BYTES}")
        return self.rfile.read(int(length))

    def _known_name(self) -> bool:
        origin = self.headers.get("Origin")
        here = self.headers.get("Host", "") in self.server.names
        if here and (origin is None or origin.removeprefix("http://") in self.server.names):
            return True
        self.close_connection = True
        self._words(403, f"this page is served only at {self.server.url}")
        return False

    def _events(self) -> None:
        if not self.server.begin_page(self.connection):
            self._words(503, f"{MAX_PAGES} pages are already open; close one")
            return
        self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
        self.close_connection = True
        self._head(200, "text/event-stream", {"Connection": "close"})
        state = self.server.state
        cursor = state.cursor()
        about = facts() | {"token_header": TOKEN_HEADER, "recording": state.recording}
        self.wfile.write(f"retry: 500\nevent: about\ndata: {compact(about)}\n\n".encode())
        while not state.closed:
            begin_s = time.monotonic()
            text = state.wait(cursor, QUIET_S)
            self.wfile.write((f"data: {text}\n\n" if text else ": nothing new\n\n").encode())
            time.sleep(max(0.0, begin_s + EVENT_S - time.monotonic()))

    def _words(self, status: int, words: str) -> None:
        self._answer(status, "application/json", compact({"words": words}).encode())

    def _answer(self, status: int, kind: str, body: bytes) -> None:
        self._head(status, kind, {"Content-Length": str(len(body))})
        self.wfile.write(body)

    def _head(self, status: int, kind: str, more: dict[str, str]) -> None:
        self.send_response(status)
        for name, value in ({"Content-Type": kind} | GUARDS | more).items():
            self.send_header(name, value)
        self.end_headers()

    def log_message(self, format: str, *args: Any) -> None:
        """Log nothing: a library does not print."""


def parse_command(body: bytes) -> tuple[str, int | None, float | str | None]:
    """Name, finger and value from a command's JSON. Raises ValueError for anything else."""
    wish = parse_json(body)
    wish = wish if isinstance(wish, dict) else {}
    name, finger, value = wish.get("do"), wish.get("finger"), wish.get("value")
    value = float(value) if type(value) is int and abs(value) < 2**53 else value
    is_value = value is None or isinstance(value, str) or (isinstance(value, float) and math.isfinite(value))
    if not isinstance(name, str) or not (finger is None or type(finger) is int) or not is_value:
        raise ValueError('expected {"do": NAME, "finger": NUMBER or null, "value": NUMBER, TEXT or null}')
    return name, finger, value
