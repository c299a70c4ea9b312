"""An emulated Net F/T box: the Nano17 of a scenario behind UDP and a configuration page, over a network that fails.

It answers START, START_BUFFERED and STOP, and sends when told how far time is; it has no clock of its own, so a
test decides what has been measured and nothing waits. Datagrams are lost, doubled and overtaken as ``network`` says.
"""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np

from biotac.calibrate.reference import rdt
from biotac.sim.nano17 import COUNTS_PER_UNIT, Nano17
from biotac.sim.source import Source

BUFFERED_RECORDS = 40

PAGE = (
    '<?xml version="1.0" encoding="utf-8"?><netftConfig><runstat>0x00000000</runstat><cfgcalsn>FT06017</cfgcalsn>'
    "<cfgcpf>{force:.0f}</cfgcpf><cfgcpt>{torque:.0f}</cfgcpt><scfgfu>N</scfgfu><scfgtu>N-m</scfgtu>"
    "<comrdte>Enabled</comrdte><comrdtrate>{rate:.0f}</comrdtrate></netftConfig>"
)


@dataclass(frozen=True)
class Network:
    """Shares of datagrams that are lost or come twice, and how many others may overtake one."""

    lost: float = 0.0
    doubled: float = 0.0
    overtaken_by: int = 0
    seed: int = 1


class NetFtBox:
    """On a free UDP port of this computer; ``port`` says which, ``http_port`` where its page is.

    ``sent`` and ``dropped`` count records. A context manager.
    """

    def __init__(self, source: Source, finger: int = 0, nano17: Nano17 | None = None, network: Network | None = None):
        its = nano17 or Nano17()
        self._at_s, self._records = its.records(source, finger)
        self._network = network or Network()
        self._rng = np.random.default_rng(self._network.seed)
        self._next = 0
        self._client: tuple[str, int] | None = None
        self._per_datagram = 1
        self._left: int | None = None  # records to send, None without end
        self.sent = self.dropped = 0
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.setblocking(False)
        self.port: int = self._socket.getsockname()[1]
        page = PAGE.format(force=COUNTS_PER_UNIT, torque=COUNTS_PER_UNIT, rate=its.rate_hz).encode()
        self._http = ThreadingHTTPServer(("127.0.0.1", 0), _handler(page))
        self.http_port = int(self._http.server_address[1])
        self._thread = threading.Thread(target=self._http.serve_forever, args=(0.01,), daemon=True)
        self._thread.start()

    def __enter__(self) -> NetFtBox:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    @property
    def streaming(self) -> bool:
        """Somebody has asked for records, and they are not all sent."""
        return self._client is not None

    def advance(self, board_s: float) -> None:
        """Hear requests, then send what is measured until the board's ``board_s``; what nobody asked for is gone."""
        self._hear()
        end = int(self._at_s.searchsorted(board_s))
        if self._client is None:
            self._next = max(self._next, end)
            return
        for datagram in self._shuffled(list(self._datagrams(end))):
            self._socket.sendto(datagram, self._client)
        if self._left == 0:
            self._client = None

    def close(self) -> None:
        """Safe to call twice."""
        self._socket.close()
        self._http.shutdown()
        self._http.server_close()
        self._thread.join()

    def _hear(self) -> None:
        while True:
            try:
                data, sender = self._socket.recvfrom(64)
            except BlockingIOError:
                return
            if len(data) != rdt.REQUEST.size:
                continue
            magic, command, count = rdt.REQUEST.unpack(data)
            if magic != rdt.MAGIC:
                continue
            if command == rdt.STOP:
                self._client = None
            elif command in (rdt.START, rdt.START_BUFFERED):
                self._client = sender
                self._per_datagram = 1 if command == rdt.START else BUFFERED_RECORDS
                self._left = None if count == rdt.ENDLESS else count

    def _datagrams(self, end: int) -> Iterator[bytes]:
        # a box sends full buffers only
        while self._next + self._per_datagram <= end and self._left != 0:
            many = self._per_datagram if self._left is None else min(self._per_datagram, self._left)
            part = self._records[self._next : self._next + many]
            self._next += many
            if self._left is not None:
                self._left -= many
            if self._rng.random() < self._network.lost:
                self.dropped += many
                continue
            self.sent += many
            yield part.tobytes()
            if self._rng.random() < self._network.doubled:
                yield part.tobytes()

    def _shuffled(self, datagrams: list[bytes]) -> list[bytes]:
        late = np.arange(len(datagrams)) + self._rng.uniform(0.0, self._network.overtaken_by + 1e-9, len(datagrams))
        return [datagrams[k] for k in np.argsort(late, kind="stable")]


def _handler(page: bytes) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            found = self.path == "/netftapi2.xml"
            self.send_response(200 if found else 404)
            self.send_header("Content-Length", str(len(page) if found else 0))
            self.end_headers()
            self.wfile.write(page if found else b"")

        def log_message(self, *words: object) -> None:
            """A library does not print."""

    return Handler
