"""The Net F/T reader against an emulated box, over real UDP that loses, doubles and reorders."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import numpy as np
import pytest
from net_ft_box import NetFtBox, Network

from biotac.calibrate.reference import rdt
from biotac.calibrate.reference.net_ft import SILENCE_S, NetFtReader, parse_address
from biotac.calibrate.reference.samples import Samples
from biotac.errors import DeviceLostError, PortError
from biotac.sim.loading import load_source
from biotac.sim.nano17 import Nano17
from biotac.sim.source import Source

STEP_S = 0.1  # 50 datagrams: they fit any socket's buffer


class Clock:
    """Wall time that only moves when it is told to."""

    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture(scope="module")
def source() -> Source:
    return load_source("press.toml", seconds=6.0)


@pytest.fixture
def box(request: pytest.FixtureRequest, source: Source, monkeypatch: pytest.MonkeyPatch) -> Iterator[NetFtBox]:
    monkeypatch.setattr("biotac.calibrate.reference.net_ft.HTTP_TIMEOUT_S", 300.0)
    with NetFtBox(source, network=getattr(request, "param", None)) as its:
        yield its


def address(box: NetFtBox, options: str = "") -> str:
    return f"netft:127.0.0.1:{box.port}?http={box.http_port}{options}"


def read_all(box: NetFtBox, reader: NetFtReader, seconds: float = 6.0) -> Samples:
    parts = []
    for k in range(round(seconds / STEP_S)):
        box.advance((k + 1) * STEP_S)
        parts.append(reader.read())
    return Samples(np.concatenate([p.t_s for p in parts]), np.concatenate([p.wrench for p in parts]))


def test_the_box_tells_its_scale_and_its_number(box: NetFtBox) -> None:
    reader = NetFtReader(parse_address(address(box)))
    assert reader.scale == Nano17().scale
    assert reader.sensor == f"Net F/T 127.0.0.1:{box.port}, calibration FT06017"
    reader.close()


def expected(box: NetFtBox, source: Source) -> tuple[np.ndarray, np.ndarray]:
    _, records = Nano17().records(source, 0)
    return records["rdt_sequence"] / 500.0, records["counts"][:, :3] / 1e6


def test_every_record_of_a_good_network(box: NetFtBox, source: Source) -> None:
    reader = NetFtReader(parse_address(address(box)))
    found = read_all(box, reader)
    t_s, force_n = expected(box, source)
    assert len(found) == len(t_s) - rdt.HOLD_RECORDS
    np.testing.assert_allclose(found.t_s, t_s[: len(found)])
    np.testing.assert_allclose(found.force_n, force_n[: len(found)])
    assert (reader.stats.lost, reader.stats.late, reader.stats.bad) == (0, 0, 0)
    reader.close()
    box.advance(9.0)
    assert not box.streaming


@pytest.mark.parametrize("box", [Network(lost=0.03, doubled=0.02, overtaken_by=12)], indirect=True)
def test_a_bad_network_costs_samples_and_no_time(box: NetFtBox, source: Source) -> None:
    reader = NetFtReader(parse_address(address(box)))
    found = read_all(box, reader)
    t_s, force_n = expected(box, source)
    place = np.searchsorted(t_s, found.t_s - 1e-6)
    np.testing.assert_allclose(found.t_s, t_s[place])
    np.testing.assert_allclose(found.force_n, force_n[place])
    assert (np.diff(found.t_s) > 0.0).all()
    assert box.dropped > 50
    # the last ones may still be held back, and those lost among them are not known to be
    assert box.dropped - rdt.HOLD_RECORDS <= reader.stats.lost <= box.dropped
    assert len(found) + reader.stats.lost == len(t_s[t_s <= found.t_s[-1]])
    assert reader.stats.late > 20
    reader.close()


def test_the_scale_can_be_given_instead_of_the_page(box: NetFtBox) -> None:
    reader = NetFtReader(parse_address(f"netft:127.0.0.1:{box.port}?cpf=2000000&cpt=1000000&rate=500"))
    found = read_all(box, reader, 1.0)
    _, records = Nano17().records(load_source("press.toml", seconds=6.0), 0)
    np.testing.assert_allclose(found.force_n, records["counts"][: len(found), :3] / 2e6)
    reader.close()


def test_a_buffered_box_sends_forty_records_at_a_time(box: NetFtBox) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.connect(("127.0.0.1", box.port))
        client.send(b"1234 what?")
        client.send(rdt.request(rdt.START_BUFFERED, 120))
        box.advance(1.0)
        decoder = rdt.RdtDecoder(Nano17().scale)
        for _ in range(3):
            datagram = client.recv(4096)
            assert len(datagram) == 40 * 36
            decoder.feed(datagram)
        assert len(decoder.take(all_of_them=True)) == 120
    assert not box.streaming


def test_silence_is_a_lost_device(box: NetFtBox) -> None:
    clock = Clock()
    reader = NetFtReader(parse_address(address(box)), steady_s=clock)
    clock.now_s = SILENCE_S
    assert len(reader.read()) == 0
    box.advance(1.0)
    clock.now_s = SILENCE_S + 1.0
    assert len(reader.read()) > 0
    clock.now_s = 2 * SILENCE_S + 1.0
    reader.read()
    clock.now_s = 2 * SILENCE_S + 1.1
    with pytest.raises(DeviceLostError, match=r"for 2\.1 s: expected 500 records per second"):
        reader.read()
    reader.close()
    reader.close()


def test_no_box(source: Source) -> None:
    with NetFtBox(source) as box:
        gone = address(box)
    with pytest.raises(PortError, match="does not answer"):
        NetFtReader(parse_address(gone))
