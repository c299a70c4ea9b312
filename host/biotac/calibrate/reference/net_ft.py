"""A Reader for an ATI Net F/T box (or NETrs, Axia Ethernet) over UDP.

Written from the published protocol and tested with an emulated box (tests/support), never with hardware.
"""

from __future__ import annotations

import contextlib
import re
import socket
import time
import urllib.request
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from dataclasses import dataclass
from urllib.parse import parse_qsl

from ...errors import DeviceLostError, InputError, PortError
from . import rdt
from .rdt import RdtDecoder, Scale
from .samples import ReaderStats, Samples

PREFIX = "netft:"
SILENCE_S = 2.0
HTTP_TIMEOUT_S = 3.0
RECEIVE_BYTES = 1 << 22  # some seconds at 7 kHz, while this program draws or writes
OPTIONS = ("cpf", "cpt", "rate", "http")
_FORM = "netft:HOST[:PORT][?cpf=COUNTS_PER_N&cpt=COUNTS_PER_NM&rate=HZ]"
# units as the box names them, without spaces, dots, stars and dashes
_FORCE = {"N": 1.0, "KN": 1000.0}
_TORQUE_NMM = {"NM": 1000.0, "NMM": 1.0, "KNM": 1e6}


@dataclass(frozen=True)
class Address:
    """Where a box is, and its scale if the address gives it."""

    host: str
    port: int
    http_port: int
    scale: Scale | None


def parse_address(text: str) -> Address:
    """The address in ``netft:HOST[:PORT][?cpf=...&cpt=...&rate=...]``. Raises InputError for anything else."""
    host, _, query = text.removeprefix(PREFIX).partition("?")
    match = re.fullmatch(r"([^:\s]+)(?::(\d{1,5}))?", host)
    options = dict(parse_qsl(query, keep_blank_values=True))
    unknown = sorted(set(options) - set(OPTIONS))
    if match is None or unknown:
        seen = f"option {unknown[0]!r}" if unknown else repr(host)
        raise InputError(f"{text}: {seen} is not valid: expected {_FORM}")
    try:
        numbers = {key: float(value) for key, value in options.items()}
    except ValueError:
        raise InputError(f"{text}: an option is not a number: expected {_FORM}") from None
    given = [key for key in ("cpf", "cpt", "rate") if key in numbers]
    if given and len(given) < 3:
        raise InputError(f"{text}: only {' and '.join(given)} given: expected cpf, cpt and rate, or none of them")
    scale = Scale(numbers["cpf"], numbers["cpt"] / rdt.NMM_PER_NM, numbers["rate"]) if given else None
    return Address(match[1], int(match[2] or rdt.PORT), int(numbers.get("http", 80)), scale)


def read_configuration(xml: bytes, where: str) -> tuple[Scale, str]:
    """Scale and calibration number from the box's netftapi2.xml."""
    try:
        root = ElementTree.fromstring(xml)
    except ElementTree.ParseError as error:
        raise InputError(f"{where}: {error}: expected the XML of a Net F/T box; check the address") from None

    def text(name: str) -> str:
        found = root.findtext(f".//{name}")
        if found is None:
            raise InputError(f"{where}: no <{name}>: expected a Net F/T box; check the address, or give {_FORM}")
        return found.strip()

    def unit(name: str, known: dict[str, float]) -> float:
        word = text(name)
        factor = known.get(re.sub(r"[\s.*·-]", "", word).upper())
        if factor is None:
            raise InputError(f"{where}: the box's unit is {word!r}: expected N, and N m or N mm; set it on its page")
        return factor

    if text("comrdte").lower() not in ("enabled", "1"):
        raise InputError(f"{where}: RDT is {text('comrdte')}: expected Enabled; enable it on the box's page")
    try:
        scale = Scale(
            float(text("cfgcpf")) / unit("scfgfu", _FORCE),
            float(text("cfgcpt")) / unit("scfgtu", _TORQUE_NMM),
            float(text("comrdtrate")),
        )
    except ValueError as error:
        raise InputError(f"{where}: {error}: expected numbers for cfgcpf, cfgcpt, comrdtrate; see its page") from None
    return scale, (root.findtext(".//cfgcalsn") or "").strip()


class NetFtReader:
    """An open stream from a box; ``sensor`` is its address and its calibration's number.

    ``steady_s`` is the clock by which silence is judged. Raises PortError when the box cannot be reached, InputError
    for a configuration that cannot be used.
    """

    def __init__(self, address: Address, *, steady_s: Callable[[], float] = time.monotonic) -> None:
        where = f"{address.host}:{address.port}"
        number, scale = "", address.scale
        if scale is None:
            url = f"http://{address.host}:{address.http_port}/netftapi2.xml"
            try:
                with urllib.request.urlopen(url, timeout=HTTP_TIMEOUT_S) as page:
                    scale, number = read_configuration(page.read(), url)
            except OSError as error:
                raise PortError(
                    f"{url} does not answer ({error}): expected a Net F/T box; check the cable, or give {_FORM}"
                ) from None
        self.scale = scale
        self.sensor = f"Net F/T {where}" + (f", calibration {number}" if number else "")
        self._where = where
        self._decoder = RdtDecoder(scale)
        self._steady_s = steady_s
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BYTES)
            self._socket.connect((address.host, address.port))
            self._socket.setblocking(False)
            self._socket.send(rdt.request(rdt.START))
        except OSError as error:
            self._socket.close()
            raise PortError(f"{where} cannot be reached ({error}); check the address and the network") from None
        self._heard_s = steady_s()

    @property
    def stats(self) -> ReaderStats:
        """Counts so far; a datagram that holds no records counts as bad."""
        decoder = self._decoder
        return ReaderStats(decoder.lost, decoder.late, decoder.bad + decoder.refused)

    def read(self, board_s: float = 0.0) -> Samples:
        """New samples that are in order. Raises DeviceLostError after SILENCE_S without a datagram."""
        heard = False
        with contextlib.suppress(BlockingIOError):
            while True:
                try:
                    self._decoder.feed(self._socket.recv(65536))
                    heard = True
                except ConnectionRefusedError:
                    break  # nothing listens there yet, or any more: SILENCE_S decides
        now_s = self._steady_s()
        if heard:
            self._heard_s = now_s
        elif now_s - self._heard_s > SILENCE_S:
            raise DeviceLostError(
                f"no data from the force sensor at {self._where} for {now_s - self._heard_s:.1f} s: expected "
                f"{self.scale.rate_hz:g} records per second; check its cable, and that no other program reads it"
            )
        return self._decoder.take()

    def close(self) -> None:
        """Stop the stream. Safe to call twice."""
        if self._socket.fileno() >= 0:
            with contextlib.suppress(OSError):
                self._socket.send(rdt.request(rdt.STOP))
            self._socket.close()
