"""A board that another program shares by Zenoh: a PORT like any other, one writer, and nobody hurt by the slow."""

from __future__ import annotations

import json
import os
import random
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from maps import make_map

import biotac
from biotac.cli.main import main
from biotac.errors import CommandRefusedError, DeviceLostError, InputError, PortError, WireVersionError
from biotac.fleet import network, rights, zenoh_link
from biotac.fleet.share import Share
from biotac.view.serving import Viewing
from biotac.wire import messages_gen as wire
from biotac.wire.framing import encode, open_frame

pytest.importorskip("zenoh")


class Shared:
    """A simulated board, shared under a name at an endpoint of its own."""

    def __init__(self, name: str = "left", source: str = "sim:press.toml?fingers=2&pace=real&seconds=600") -> None:
        self.endpoint = f"tcp/127.0.0.1:{free_port()}"
        self.name, self.source = name, source
        self.stack = ExitStack()
        self.start()

    def start(self) -> None:
        self.session = self.stack.enter_context(closing(network.open_session(self.name, listen=self.endpoint)))
        self.hand = self.stack.enter_context(biotac.open(self.source, reconnect=True))
        self.share = self.stack.enter_context(closing(Share(self.hand, self.session, self.name)))

    def port(self, more: str = "") -> str:
        return f"zenoh:{self.name}?connect={self.endpoint}{more}"

    @contextmanager
    def client(self) -> Iterator[Any]:
        with closing(network.open_session("test", connect=self.endpoint)) as session:
            yield session


@pytest.fixture(scope="module")
def shared() -> Iterator[Shared]:
    sharing = Shared()
    with sharing.stack:
        yield sharing


def until(hand: biotac.Hand, frames: int) -> int:
    """Read that many; the stream's own time, not the wall's."""
    seen = 0
    for batch in hand.batches():
        seen += len(batch.wire)
        if seen >= frames:
            break
    return seen


def test_every_command_that_changes_something_needs_the_writer() -> None:
    free = {m.__name__ for m in wire.ANSWERS if not rights.needs_writer(m.ID)}
    assert free == {"HelloRequest", "Start", "Stop", "Ping"} | {
        m.__name__ for m in wire.ANSWERS if m.__name__.startswith(("Get", "Read"))
    }
    assert rights.needs_writer(0xEE)  # of a newer wire


def test_it_is_a_port_like_any_other(shared, tmp_path, capsys) -> None:
    path = tmp_path / "a.mcap"
    with biotac.open(shared.port()) as hand:
        assert (hand.info.boot_id, hand.fingers) == (shared.hand.info.boot_id, shared.hand.fingers)
        assert hand.board.settings() == shared.hand.board.settings()
        hand.record(path)
        until(hand, 100)
        assert hand.link.batches_lost == hand.stats.crc_errors == 0
        assert hand.stats.frames_lost <= shared.hand.stats.frames_lost
    recording = biotac.Recording(path)
    assert len(recording.frames) >= 100 and not recording.problems
    assert main(["check", str(path)]) == 0
    assert main(["info", shared.port(), "--json"]) == 0
    with closing(Viewing(shared.port(), port=0)) as viewing:
        assert viewing.server.token


def test_readers_have_the_same_frames_and_no_answers_of_others(shared) -> None:
    """One asks all the time; the other's stream has no reply in it but its own."""
    with biotac.open(shared.port()) as asking, biotac.open(shared.port()) as reading:
        reading.stream()
        messages: list[Any] = []
        seen = 0
        for batch in reading.batches():
            asking.status()
            messages += batch.messages
            seen += len(batch.wire)
            if seen > 100:
                break
        answers = [m for m in messages if getattr(m, "req_id", 0)]
        assert {m.command for m in answers} <= {wire.Start.ID, wire.Subscribe.ID}
        assert reading.stats.frames_lost <= shared.hand.stats.frames_lost


def test_who_may_command_is_said_and_kept_to(shared, capsys) -> None:
    with biotac.open(shared.port()) as reader:
        with pytest.raises(CommandRefusedError, match=r"open it with &write=yes \(one program") as refused:
            reader.tare(0)
        assert refused.value.exit_code == 7
        with biotac.open(shared.port("&write=yes")) as writer:
            assert shared.share.writer is not None
            writer.board.set_setting(wire.Setting.CONTACT_ENERGY_COUNT2, 1001)
            assert reader.board.setting(wire.Setting.CONTACT_ENERGY_COUNT2) == 1001
            writer.board.set_map(1, make_map(1))  # for which the board's stream has to stand still
            assert reader.board.get_map(1) is not None
            writer.board.clear_map(1)
            with pytest.raises(
                PortError, match=r"only one program may write at a time \(now .+\); open without write=yes"
            ):
                biotac.open(shared.port("&write=yes"))
            assert main(["list", "--zenoh", shared.endpoint, "--json"]) == 0
            (listed,) = json.loads(capsys.readouterr().out)["zenoh"]
            assert listed["port"] == "zenoh:left" and listed["writer"] == shared.share.writer
            until(writer, 20)  # it streams again
    gone = threading.Event()
    for _ in range(1000):
        if shared.share.writer is None:
            gone.set()
            break
        shared.hand.status()
    assert gone.is_set()
    with biotac.open(shared.port("&write=yes")) as writer:
        writer.board.set_setting(wire.Setting.CONTACT_ENERGY_COUNT2, 1000)


def test_the_sharing_side_enforces_it(shared) -> None:
    """Of a client that does not keep to the rules: no claim, a wrong secret, damaged bytes, an unknown command."""
    before = shared.hand.board.setting(wire.Setting.CONTACT_ENERGY_COUNT2)
    change = wire.SetSetting(9, wire.Setting.CONTACT_ENERGY_COUNT2, before + 5)
    with shared.client() as session, biotac.open(shared.port("&write=yes")) as writer:
        stop = encode(wire.Stop.ID, wire.Stop(9).pack())[:-1]  # each reader's own affair, not to be done to all
        (reply,) = session.get(network.key("left", "command"), payload=stop)
        refused = open_frame(reply.ok.payload.to_bytes()[:-1])
        assert refused is not None
        assert wire.Reply.unpack(refused[1]) == wire.Reply(9, wire.Stop.ID, wire.Error.NOT_HERE)
        until(writer, 20)
        for secret in (b"", b"\0" * 32, network.signature(b"", 1, encode(change.ID, change.pack())[:-1])):
            replies = list(
                session.get(
                    network.key("left", "command"), payload=encode(change.ID, change.pack())[:-1], attachment=secret
                )
            )
            (answer,) = [open_frame(reply.ok.payload.to_bytes()[:-1]) for reply in replies]
            assert answer is not None
            assert wire.Reply.unpack(answer[1]) == wire.Reply(9, change.ID, wire.Error.NOT_HERE)
        for payload in (b"", b"\0", b"no frame", encode(0x89, b"")[:-1]):
            list(session.get(network.key("left", "command"), payload=payload, timeout=0.2))
    assert shared.hand.board.setting(wire.Setting.CONTACT_ENERGY_COUNT2) == before


def test_a_stranger_gets_no_secret_and_blocks_nobody(shared) -> None:
    """Queryables at the writer's keys hear its claim and its commands; what they hear cannot be used again."""
    heard: list[tuple[bytes, bytes]] = []

    def hear(query: Any) -> None:
        heard.append((query.payload.to_bytes(), query.attachment.to_bytes() if query.attachment else b""))

    before = shared.hand.board.setting(wire.Setting.CONTACT_ENERGY_COUNT2)
    with shared.client() as session:
        kept = [session.declare_queryable(network.key("left", what), hear) for what in ("claim", "command")]
        kept.append(session.liveliness().declare_token(network.key("left", "live/feed")))  # of no board
        with biotac.open(shared.port("&write=yes")) as writer:
            writer.board.set_setting(wire.Setting.CONTACT_ENERGY_COUNT2, before + 7)
            assert shared.share._secret and not any(shared.share._secret in data + sent for data, sent in heard)
            writer.board.set_setting(wire.Setting.CONTACT_ENERGY_COUNT2, before)
            assert len(heard) > 2
            for payload, attachment in list(heard):
                list(session.get(network.key("left", "command"), payload=payload, attachment=attachment, timeout=1.0))
            assert shared.hand.board.setting(wire.Setting.CONTACT_ENERGY_COUNT2) == before
            until(writer, 20)
        for declared in kept:
            declared.undeclare()


def test_nothing_leaves_this_computer_without_a_configuration(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.delenv("ZENOH_CONFIG", raising=False)
    for endpoint in ("tcp/0.0.0.0:7447", "tcp/192.0.2.1:7447", "tls/[::]:7447", "udp/example.org:7447", "nonsense"):
        for what in ("connect", "listen"):
            with pytest.raises(InputError, match="leaves this computer"):
                network.open_session("left", **{what: endpoint})
    with closing(network.open_session("left")) as session:
        assert session.zid()
        assert {address for address in listening_at() if address != LOOPBACK_HEX} == set()


LOOPBACK_HEX = "0100007F"


def listening_at() -> set[str]:
    """IPv4 and IPv6 addresses at which this process listens for TCP, as the kernel writes them."""
    inodes = {os.readlink(fd) for fd in Path("/proc/self/fd").iterdir() if fd.exists()}
    found = set()
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/self/net/{table}").read_text().splitlines()[1:]:
            _, local, _, state, *_, inode = line.split()[:10]
            if state == "0A" and f"socket:[{inode}]" in inodes:
                found.add(local.partition(":")[0])
    return found


def test_a_client_is_written_from_the_page(shared) -> None:
    """host/docs/guides/network.md and SPEC.md are all it needs: Zenoh, cobs and zlib, nothing of ours."""
    import struct
    import zlib

    import zenoh
    from cobs import cobs

    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([shared.endpoint]))
    batches: list[bytes] = []
    enough = threading.Event()

    def take(sample: zenoh.Sample) -> None:
        batches.append(sample.payload.to_bytes())
        if len(batches) >= 50:
            enough.set()

    with zenoh.open(config) as session:
        (info,) = [json.loads(reply.ok.payload.to_bytes()) for reply in session.get("biotac/left/info") if reply.ok]
        subscriber = session.declare_subscriber(f"biotac/left/wire/{info['epoch']}", take)
        assert enough.wait(30)
        subscriber.undeclare()
    numbers = [struct.unpack_from("<Q", batch)[0] for batch in batches]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    plain = [cobs.decode(frame) for batch in batches for frame in batch[8:].split(b"\0")[:-1]]
    assert all(zlib.crc32(p[:-4]) == int.from_bytes(p[-4:], "little") for p in plain)
    assert {p[7] for p in plain if p[0] == wire.Frame.ID} == set(info["fingers"])  # the finger, after id, seq and t_us


def garbage(draw: random.Random) -> bytes:
    """No message, half of one, many, too long, or a whole one of any id with bytes that mean nothing."""
    message = encode(draw.choice([*wire.MESSAGES, draw.randrange(1, 256)]), draw.randbytes(draw.randrange(60)))[:-1]
    known = draw.choice(list(wire.ANSWERS))
    of_its_length = encode(known.ID, draw.randbytes(known.STRUCT.size))[:-1]
    cut = message[: draw.randrange(len(message))]
    noise = draw.randbytes(draw.choice([0, 1, 7, 9, 300, 70_000]))
    return draw.choice([noise, cut, message, message, of_its_length, of_its_length, (message + b"\0") * 1000])


@pytest.mark.parametrize("tries", [150, pytest.param(1500, marks=pytest.mark.nightly)])
def test_what_means_nothing_is_left_alone(shared, capfd, tries: int) -> None:
    """At every key that is asked, and no claim of somebody who is not there."""
    before, draw = shared.hand.board.settings(), random.Random(tries)
    with shared.client() as session:
        for _ in range(tries):
            what = draw.choice(["command", "command", "claim", "info"])
            secret = draw.choice([None, b"", draw.randbytes(32)])
            list(session.get(network.key("left", what), payload=garbage(draw), attachment=secret, timeout=5.0))
        for who in (b"", b"nobody", b"x" * 70_000, b"\xff", b"*", b"a/b"):
            list(session.get(network.key("left", "claim"), payload=who, timeout=5.0))
        assert [facts["name"] for facts in network.shared(session)] == ["left"]
    assert shared.share.writer is None and shared.hand.board.settings() == before
    with biotac.open(shared.port("&write=yes")) as writer:
        until(writer, 20)
    assert "Traceback" not in capfd.readouterr().err


def test_batches_that_are_not_the_boards_are_left_alone(shared) -> None:
    """Played again, of no number or of a wild one, too long."""
    draw, kept = random.Random(3), []
    with shared.client() as session, biotac.open(shared.port()) as hand:
        key = network.key("left", f"wire/{shared.share.epoch}")
        listening = session.declare_subscriber(key, lambda sample: kept.append(sample.payload.to_bytes()))
        until(hand, 60)
        listening.undeclare()
        for data in [*kept[:5], b"", bytes(8), network.NUMBER.pack(2**64 - 1) + b"\1\0", *kept[:5]]:
            session.put(key, data)
        for _ in range(20):
            session.put(key, network.NUMBER.pack(2**63) + draw.randbytes(draw.choice([1, 300, 5 << 20])))
        rows = 0
        seen: dict[int, int] = {}
        for batch in hand.batches():
            for finger, seq in zip(batch.frames["finger"].tolist(), batch.seq.tolist(), strict=True):
                assert seq > seen.get(finger, -1)
                seen[finger] = seq
            rows += len(batch.frames)
            if rows > 200:
                break
        assert hand.link.batches_lost == hand.stats.disordered == 0
        assert hand.stats.frames_lost <= shared.hand.stats.frames_lost


def test_who_says_nonsense_of_himself_is_not_listed(shared, capsys) -> None:
    good = {
        "name": "x",
        "epoch": "0",
        "board": "b",
        "serial_number": "s",
        "firmware": "f",
        "wire": "1.0",
        "fingers": [0],
    }
    output = [b"", b"\xff", b"[]", b"[" * 200_000, b"{}", b'{"name": "x"}', json.dumps(good | {"fingers": 5}).encode()]
    output += [json.dumps(good | {"writer": 5}).encode(), json.dumps(good | {"name": "a\x1b[2J"}).encode()]
    with shared.client() as session:
        for data in output:
            here = session.declare_queryable(network.key("x", "info"), lambda q, d=data: q.reply(q.key_expr, d))
            assert [facts["name"] for facts in network.shared(session)] == ["left"], data[:40]
            assert main(["list", "--zenoh", shared.endpoint]) == 0
            here.undeclare()
    assert capsys.readouterr().err == ""


def test_a_slow_reader_loses_whole_batches_counted_and_hurts_nobody(shared, monkeypatch) -> None:
    with biotac.open(shared.port()) as slow, biotac.open(shared.port()) as quick:
        monkeypatch.setattr(slow.link, "max_waiting_bytes", 20_000)
        until(slow, 20)
        may_read, read = threading.Event(), slow.link.read
        monkeypatch.setattr(slow.link, "read", lambda timeout_s: may_read.wait() and read(timeout_s))
        until(quick, 300)
        may_read.set()
        assert quick.link.batches_lost == 0
        assert quick.stats.frames_lost <= shared.hand.stats.frames_lost  # before it was shared: a busy computer's
        until(slow, 100)
        assert slow.link.batches_lost > 0 and slow.stats.frames_lost > 0
        assert slow.stats.crc_errors == slow.stats.other_errors == 0  # whole ones
        lost = slow.link.batches_lost
        until(slow, 100)
        assert slow.link.batches_lost == lost  # and it goes on


def test_round_trips_include_the_network(shared, monkeypatch) -> None:
    """A network of 60 ms: the clock's round trip, and so its bounds, are no shorter."""
    real = zenoh_link.ZenohLink._ask

    def far(self: Any, *args: Any) -> None:
        time.sleep(0.06)
        real(self, *args)

    monkeypatch.setattr(zenoh_link.ZenohLink, "_ask", far)
    with biotac.open(shared.port()) as hand:
        hand.sync()
        assert hand.clock.quickest_round_trip_s >= 0.06


def test_two_of_a_name_and_other_bad_ports_are_one_line(shared, capsys) -> None:
    with shared.client() as session, pytest.raises(PortError, match="choose another name"):
        Share(shared.hand, session, "left")
    for port, code, cure in (
        (shared.port().replace("left", "right"), 3, "biotac share PORT --zenoh right"),
        (shared.port().replace("left", "right"), 3, ": zenoh:right?connect=tcp/HOST:7447\n"),
        ("zenoh:left?connect=tcp/127.0.0.1:1", 3, "that `biotac share` is running, and"),
        ("zenoh:?write=yes", 3, "`biotac list --zenoh` lists names"),
        ("zenoh:left?write=maybe", 3, "expected zenoh:NAME"),
        (shared.port("&config=/no/such.json5"), 2, "Zenoh rejects its endpoint or configuration file such.json5"),
    ):
        assert main(["info", port]) == code
        output = capsys.readouterr().err.splitlines(keepends=True)
        assert len(output) == 1 and cure in output[0]


def test_another_wire_version_is_5() -> None:
    sharing = Shared("old")
    with sharing.stack:
        sharing.hand._board.reader.hello = replace(sharing.hand.info, wire_major=wire.WIRE_MAJOR + 1)
        with pytest.raises(WireVersionError) as error:
            biotac.open(sharing.port())
        assert error.value.exit_code == 5


def test_a_board_that_is_taken_off_is_lost_and_found_again(tmp_path: Path) -> None:
    sharing = Shared("coming")
    with sharing.stack, biotac.open(sharing.port(), reconnect=True) as hand, biotac.open(sharing.port()) as without:
        hand.record(tmp_path / "a.mcap")
        until(hand, 20)
        without.stream()
        sharing.stack.close()
        with pytest.raises(DeviceLostError, match="is no longer shared"):
            until(without, 10_000)
        sharing.start()
        gaps: list[Any] = []
        for batch in hand.batches():
            gaps += [m for m in batch.messages if isinstance(m, biotac.Gap)]
            if gaps:
                break
        assert gaps[0].reason == "rebooted"  # another process, so another boot
        until(hand, 20)
    first, second = biotac.Recording(tmp_path / "a.mcap"), biotac.Recording(tmp_path / "a.2.mcap")
    assert len(first.frames) >= 20 <= len(second.frames)
    gap = (first.gaps + second.gaps)[0]
    assert gap.back_at_ns > gap.lost_at_ns > 0  # of stated length


def reached(folder: Path, endpoint: str, of_server: Any, of_clients: list[Any]) -> list[bool]:
    """Who gets through to a board's program, each with Zenoh's own configuration or, for None, without."""

    def file(name: str, transport: Any) -> Path | None:
        if transport is None:
            return None
        path = folder / f"{name}.json5"
        path.write_text(json.dumps({"transport": transport}))
        return path

    seen = []
    with closing(network.open_session("left", listen=endpoint, config=file("server", of_server))) as server:
        here = server.declare_queryable(network.key("left", "info"), lambda query: query.reply(query.key_expr, b"{}"))
        for k, transport in enumerate(of_clients):
            try:
                with closing(network.open_session("t", connect=endpoint, config=file(f"{k}", transport))) as session:
                    seen.append(any(reply.ok for reply in session.get(network.key("left", "info"), timeout=1.0)))
            except PortError as error:
                assert "password or a certificate" in str(error)
                seen.append(False)
        here.undeclare()
    return seen


def free_port() -> int:
    with closing(socket.socket()) as free:
        free.bind(("127.0.0.1", 0))
        number: int = free.getsockname()[1]
        return number


def test_a_password_keeps_others_out(tmp_path: Path) -> None:
    (tmp_path / "users").write_text("lab:good\n")
    good, bad = ({"auth": {"usrpwd": {"user": "lab", "password": word}}} for word in ("good", "bad"))
    server = {"auth": {"usrpwd": {"user": "lab", "password": "good", "dictionary_file": str(tmp_path / "users")}}}
    assert reached(tmp_path, f"tcp/127.0.0.1:{free_port()}", server, [good, bad, None]) == [True, False, False]


@pytest.mark.nightly
def test_tls_keeps_others_out(tmp_path: Path) -> None:
    """Certificates by openssl, as host/docs/guides/network.md says."""
    for name in ("board", "other"):
        options = ["-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=localhost"]
        options += ["-addext", "subjectAltName=DNS:localhost", "-addext", "basicConstraints=critical,CA:FALSE"]
        files = ["-keyout", str(tmp_path / f"{name}.key"), "-out", str(tmp_path / f"{name}.pem")]
        subprocess.run(["openssl", "req", *options, *files], check=True, capture_output=True)
    board, other = ({"link": {"tls": {"root_ca_certificate": str(tmp_path / f"{n}.pem")}}} for n in ("board", "other"))
    keys = {"listen_private_key": str(tmp_path / "board.key"), "listen_certificate": str(tmp_path / "board.pem")}
    server = {"link": {"tls": keys}}
    assert reached(tmp_path, f"tls/localhost:{free_port()}", server, [board, other, None]) == [True, False, False]


@pytest.mark.nightly
def test_a_gateway_that_is_killed_leaves_a_gap_in_every_recording(tmp_path: Path) -> None:
    """kill -9 of `biotac share`, three seconds of nothing, and another one of the same name."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    source = "sim:press.toml?fingers=5&pace=real&seconds=300"
    command = [sys.executable, "-m", "biotac", "share", source, "--zenoh", "left", "--listen", endpoint]

    def serve() -> subprocess.Popen[str]:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert process.stdout is not None
        with process.stdout as output:
            assert "is shared" in output.readline()
        return process

    away_s = 3.0
    with ExitStack() as stack:
        serving = serve()
        port = f"zenoh:left?connect={endpoint}"
        hands = [stack.enter_context(biotac.open(port, reconnect=True)) for _ in range(3)]
        for k, hand in enumerate(hands):
            hand.record(tmp_path / f"{k}.mcap")
            hand.stream()
            hand.stream()
        while any(hand.stats.frames < 200 for hand in hands):
            time.sleep(0.05)
        killed_ns = time.time_ns()
        serving.kill()
        serving.wait()
        time.sleep(away_s)
        serving = serve()
        stack.callback(serving.wait)
        stack.callback(serving.terminate)
        back_ns = time.time_ns()
        while any(hand.stats.gaps == 0 for hand in hands):
            time.sleep(0.05)
        seen = [hand.stats.frames for hand in hands]
        while any(hand.stats.frames < before + 200 for hand, before in zip(hands, seen, strict=True)):
            time.sleep(0.05)
        assert all(hand.link.batches_lost == 0 for hand in hands)
    for k in range(3):
        first, second = biotac.Recording(tmp_path / f"{k}.mcap"), biotac.Recording(tmp_path / f"{k}.2.mcap")
        assert len(first.frames) >= 200 <= len(second.frames)
        (gap,) = {(gap.lost_at_ns, gap.back_at_ns) for gap in first.gaps + second.gaps}
        assert killed_ns < gap[0] < gap[1] and gap[1] > back_ns  # by this computer's clock
        print(
            f"reader {k}: {(gap[0] - killed_ns) / 1e9:.2f} s after the kill, a gap of {(gap[1] - gap[0]) / 1e9:.2f} s"
        )
