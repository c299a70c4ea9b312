"""A board that another program shares by Zenoh: a PORT like any other, one writer, and no harm from a slow reader."""

import json
import random
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest
from capture import Capture
from maps import make_map
from served_board import free_port

import biotac
from biotac.cli.main import main
from biotac.errors import CommandRefusedError, DeviceLostError, PortError
from biotac.extras.zenoh import network, rights
from biotac.extras.zenoh.share import Share
from biotac.view.serving import Viewing
from biotac.wire import messages_gen as wire
from biotac.wire.framing import encode, open_frame

pytest.importorskip("zenoh")


class Shared:
    """A simulated board, shared under a name at a separate endpoint."""

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
    """One asks all the time; the other's stream has only that hand's replies in it."""
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
            writer.board.set_map(1, make_map(1))  # the board's stream has to stand still for it
            assert reader.board.get_map(1) is not None
            writer.board.clear_map(1)
            with pytest.raises(PortError, match=r"only one program may write at a time \(now .+\); open without"):
                biotac.open(shared.port("&write=yes"))
            assert main(["list", "--zenoh", shared.endpoint, "--json"]) == 0
            (listed,) = json.loads(capsys.readouterr().out)["zenoh"]
            assert listed["port"] == "zenoh:left" and listed["writer"] == shared.share.writer
            until(writer, 20)  # it streams again
    for _ in range(1000):
        if shared.share.writer is None:
            break
        shared.hand.status()
    assert shared.share.writer is None
    with biotac.open(shared.port("&write=yes")) as writer:
        writer.board.set_setting(wire.Setting.CONTACT_ENERGY_COUNT2, 1000)


def refused(session: Any, message: Any, secret: bytes | None = None) -> bool:
    """Whether a command of another client is answered with NOT_HERE."""
    payload = encode(message.ID, message.pack())[:-1]
    (reply,) = session.get(network.key("left", "command"), payload=payload, attachment=secret)
    opened = open_frame(reply.ok.payload.to_bytes()[:-1])
    assert opened is not None
    return wire.Reply.unpack(opened[1]) == wire.Reply(message.req_id, message.ID, wire.Error.NOT_HERE)


def test_the_sharing_side_enforces_it(shared) -> None:
    """Commands of a client that breaks the rules: no claim, a wrong secret, damaged bytes, an unknown command."""
    before = shared.hand.board.setting(wire.Setting.CONTACT_ENERGY_COUNT2)
    change = wire.SetSetting(9, wire.Setting.CONTACT_ENERGY_COUNT2, before + 5)
    with shared.client() as session, biotac.open(shared.port("&write=yes")) as writer:
        assert refused(session, wire.Stop(9))  # each reader's own affair, not to be done to all
        until(writer, 20)
        for secret in (b"", b"\0" * 32, network.signature(b"", 1, encode(change.ID, change.pack())[:-1])):
            assert refused(session, change, secret)
        for payload in (b"", b"\0", b"no frame", encode(0x89, b"")[:-1]):
            list(session.get(network.key("left", "command"), payload=payload, timeout=0.2))
    assert shared.hand.board.setting(wire.Setting.CONTACT_ENERGY_COUNT2) == before


def test_a_stranger_gets_no_secret_and_blocks_nobody(shared) -> None:
    """Queryables at the writer's keys hear the claim and the commands; nothing heard can be used again."""
    received: list[tuple[bytes, bytes]] = []

    def receive(query: Any) -> None:
        received.append((query.payload.to_bytes(), query.attachment.to_bytes() if query.attachment else b""))

    before = shared.hand.board.setting(wire.Setting.CONTACT_ENERGY_COUNT2)
    with shared.client() as session:
        kept = [session.declare_queryable(network.key("left", kind), receive) for kind in ("claim", "command")]
        kept.append(session.liveliness().declare_token(network.key("left", "live/feed")))  # of no board
        with biotac.open(shared.port("&write=yes")) as writer:
            writer.board.set_setting(wire.Setting.CONTACT_ENERGY_COUNT2, before + 7)
            writer.board.set_setting(wire.Setting.CONTACT_ENERGY_COUNT2, before)
            heard = b"".join(data + sent for data, sent in received)
            secrets = {heard[k : k + network.SECRET_BYTES] for k in range(len(heard))}
            signed = [(data, sent) for data, sent in received if sent]
            for data, sent in signed:
                (count,) = network.COUNT.unpack_from(sent)
                assert sent not in {network.signature(secret, count, data) for secret in secrets}
            assert len(received) > 2 and signed
            for payload, attachment in list(received):
                list(session.get(network.key("left", "command"), payload=payload, attachment=attachment, timeout=1.0))
            assert shared.hand.board.setting(wire.Setting.CONTACT_ENERGY_COUNT2) == before
            until(writer, 20)
        for declared in kept:
            declared.undeclare()


def test_a_client_is_written_from_the_page(shared) -> None:
    """host/docs/guides/network.md and SPEC.md suffice for a client: Zenoh, cobs and zlib, nothing of ours."""
    import struct
    import zlib

    import zenoh
    from cobs import cobs

    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([shared.endpoint]))
    with zenoh.open(config) as session:
        (info,) = [json.loads(reply.ok.payload.to_bytes()) for reply in session.get("biotac/left/info") if reply.ok]
        subscriber = session.declare_subscriber(f"biotac/left/wire/{info['epoch']}")
        batches = [subscriber.recv().payload.to_bytes() for _ in range(50)]
        subscriber.undeclare()
    numbers = [struct.unpack_from("<Q", batch)[0] for batch in batches]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    plain = [cobs.decode(frame) for batch in batches for frame in batch[8:].split(b"\0")[:-1]]
    assert all(zlib.crc32(p[:-4]) == int.from_bytes(p[-4:], "little") for p in plain)
    assert {p[7] for p in plain if p[0] == wire.FrameMessage.ID} == set(info["fingers"])  # after id, seq and t_us


def garbage(draw: random.Random) -> bytes:
    """No message, half a message, several, too long a one, or a whole one of any id with random bytes."""
    message = encode(draw.choice([*wire.MESSAGES, draw.randrange(1, 256)]), draw.randbytes(draw.randrange(60)))[:-1]
    known = draw.choice(list(wire.ANSWERS))
    of_its_length = encode(known.ID, draw.randbytes(known.STRUCT.size))[:-1]
    cut = message[: draw.randrange(len(message))]
    noise = draw.randbytes(draw.choice([0, 1, 7, 9, 300, 70_000]))
    return draw.choice([noise, cut, message, message, of_its_length, of_its_length, (message + b"\0") * 1000])


def test_what_means_nothing_is_left_alone(shared, capfd) -> None:
    """At every key that is asked, and no claim of an absent writer."""
    before, draw = shared.hand.board.settings(), random.Random(1)
    with shared.client() as session:
        for _ in range(150):
            kind = draw.choice(["command", "command", "claim", "info"])
            secret = draw.choice([None, b"", draw.randbytes(32)])
            list(session.get(network.key("left", kind), payload=garbage(draw), attachment=secret, timeout=5.0))
        for claim in (b"", b"nobody", b"x" * 70_000, b"\xff", b"*", b"a/b"):
            list(session.get(network.key("left", "claim"), payload=claim, timeout=5.0))
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
        rows = hand.read(1.0)
        assert all((np.diff(rows["seq"][rows["finger"] == finger].astype(int)) > 0).all() for finger in hand.fingers)
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


def test_a_slow_reader_loses_whole_batches_counted_and_hurts_nobody(shared) -> None:
    with biotac.open(shared.port()) as slow, biotac.open(shared.port()) as quick:
        room_bytes = slow.link.max_waiting_bytes
        slow.link.max_waiting_bytes = 20_000
        until(slow, 20)
        slow.add(standstill := Capture(still=True))
        until(quick, 300)
        slow.link.max_waiting_bytes = room_bytes  # enough for a busy computer's delays in reading
        standstill.resume.set()
        assert quick.link.batches_lost == 0
        assert quick.stats.frames_lost <= shared.hand.stats.frames_lost  # before it was shared: a busy computer's
        until(slow, 100)
        assert slow.link.batches_lost > 0 and slow.stats.frames_lost > 0
        assert slow.stats.crc_errors == slow.stats.other_errors == 0  # whole ones
        lost = slow.link.batches_lost
        until(slow, 100)
        assert slow.link.batches_lost == lost  # and it goes on


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


def test_who_asks_while_a_board_is_being_shared_gets_no_answer() -> None:
    session, query = MagicMock(), MagicMock()

    def declared(key: str, answer: Any) -> MagicMock:
        if key.endswith("/info"):
            answer(query)
        return MagicMock()

    session.declare_queryable = declared
    with biotac.open("sim:press.toml") as hand, closing(Share(hand, session, "left")):
        assert not query.reply.called


def next_gap(hand: biotac.Hand) -> biotac.Gap:
    return next(m for batch in hand.batches() for m in batch.messages if isinstance(m, biotac.Gap))


def recorded_gap(path: Path, frames: int) -> biotac.Gap:
    """Between a recording and the next part of it, each of at least so many frames."""
    first, second = biotac.Recording(path), biotac.Recording(path.with_suffix(".2.mcap"))
    assert len(first.frames) >= frames <= len(second.frames)
    return (first.gaps + second.gaps)[0]


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
        assert next_gap(hand).reason == "rebooted"  # another process, so another boot
        until(hand, 20)
    gap = recorded_gap(tmp_path / "a.mcap", 20)
    assert gap.back_at_ns > gap.lost_at_ns > 0  # of stated length


@pytest.mark.nightly
def test_a_gateway_that_is_killed_leaves_a_gap(tmp_path: Path) -> None:
    """kill -9 of `biotac share`, and another one of the same name."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    source = "sim:press.toml?fingers=5&pace=real&seconds=300"
    command = [sys.executable, "-m", "biotac", "share", source, "--zenoh", "left", "--listen", endpoint]

    def serve() -> subprocess.Popen[str]:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert process.stdout is not None
        with process.stdout as output:
            assert "is shared" in output.readline()
        return process

    serving = serve()
    with biotac.open(f"zenoh:left?connect={endpoint}", reconnect=True) as hand:
        hand.record(tmp_path / "a.mcap")
        begin_ns = time.time_ns()
        until(hand, 200)
        serving.kill()
        serving.wait()
        serving = serve()
        back_ns = time.time_ns()
        next_gap(hand)
        until(hand, 200)
        assert hand.link.batches_lost == 0
    serving.terminate()
    serving.wait()
    gap = recorded_gap(tmp_path / "a.mcap", 200)
    assert begin_ns < gap.lost_at_ns < back_ns < gap.back_at_ns  # by this computer's clock, of both rows


def test_sharing_ends_with_its_source(capsys) -> None:
    source = "sim:press.toml?seconds=0.3&pace=fast"
    assert main(["share", source, "--zenoh", "short", "--listen", f"tcp/127.0.0.1:{free_port()}"]) == 0
    assert "is shared as zenoh:short" in capsys.readouterr().out


ENDS = """
import biotac
hand = biotac.open("{port}")
print(len(hand.read(seconds=0.1)))
"""


def test_a_program_that_does_not_close_its_hand_ends(shared: Any) -> None:
    ended = subprocess.run([sys.executable, "-c", ENDS.format(port=shared.port())], capture_output=True, timeout=300)
    assert ended.stdout.split() and ended.returncode == 0, ended.stderr
