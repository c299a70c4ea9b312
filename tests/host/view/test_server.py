"""The server without a browser: the requests that each client may make, and that nobody slows the board."""

import contextlib
import http.client
import json
import random
import re
import socket
import threading
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from live_board import WAIT_S, until
from served_page import fingers_shown, health

import biotac
from biotac.cli.main import main
from biotac.hand.opening import shake_hands
from biotac.recording.replay.link import ReplayLink
from biotac.recording.replay.playback import Playback
from biotac.view.overview import overview
from biotac.view.player import Player, RecordingOpener
from biotac.view.reader import PageReader
from biotac.view.rows import FRAME_ROW, frame_rows
from biotac.view.server import MAX_CONNECTIONS, MAX_PAGES, TOKEN_HEADER
from biotac.view.serving import lasting
from biotac.view.state import KEPT_ROWS, PageState, tared
from biotac.wire import messages_gen as wire
from biotac.wire.frames import electrode_signals


def ask(viewing, method: str, path: str, body: object = None, **headers: str) -> tuple[int, bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", viewing.server.server_port, timeout=300)
    text = body if isinstance(body, str) else json.dumps(body)
    connection.request(
        method, path, None if body is None else text, {k.replace("_", "-"): v for k, v in headers.items()}
    )
    answer = connection.getresponse()
    got = answer.status, answer.read()
    connection.close()
    return got


def test_commands_need_the_secret_the_origin_and_sense(make_player, view_of) -> None:
    player = make_player()
    viewing = view_of(lambda: player)
    good = {TOKEN_HEADER.replace("-", "_"): viewing.server.token}
    tare = {"do": "tare", "finger": 3}
    assert ask(viewing, "POST", "/command", tare)[0] == 403
    assert ask(viewing, "POST", "/command", tare, **good | {"X_Biotac_Token": "guess"})[0] == 403
    assert ask(viewing, "POST", "/command", tare, **good, Origin="http://example.org")[0] == 403
    assert ask(viewing, "POST", "/command", tare, **good, Host="example.org")[0] == 403
    assert ask(viewing, "POST", "/elsewhere", tare, **good)[0] == 404
    assert [ask(viewing, "HEAD", path)[0] for path in ("/", "/main.js?v", "/nothing")] == [200, 200, 404]
    not_utf8 = ask(viewing, "POST", "/command", b"\xff\xfe{".decode("latin-1"), **good)
    assert not_utf8[0] == 400 and b"decode" in not_utf8[1]
    for nonsense in ("", "{", "[1]", '{"do": 1}', '{"do": "tare", "finger": "x"}', '{"do": "tare", "finger": true}',
                     '{"do": "seek", "value": [1]}', '{"do": "seek", "value": NaN}', "[" * 999):  # fmt: skip
        assert ask(viewing, "POST", "/command", nonsense, **good)[0] == 400
    assert ask(viewing, "POST", "/command", {"do": "x" * 2000}, **good)[0] == 400
    assert ask(viewing, "POST", "/command", {"do": "fly"}, **good)[0] == 409
    assert ask(viewing, "POST", "/command", {"do": "seek", "value": 3}, **good)[0] == 409  # not in a board's time
    assert player.commands == []
    status, body = ask(viewing, "POST", "/command", tare, **good, Origin=viewing.server.url.rstrip("/"))
    assert (status, json.loads(body)) == (200, {"words": "done as asked"})
    assert player.commands == [("tare", 3)]


def test_the_secret_is_in_the_pages_address_and_nowhere_that_is_served(make_player, view_of) -> None:
    viewing = view_of(lambda: make_player())
    token = viewing.server.token
    assert viewing.url == f"{viewing.server.url}#{token}" and len(token) >= 32
    for name in ("", *viewing.server.files):
        assert token.encode() not in ask(viewing, "GET", f"/{name}")[1]
    stream = socket.create_connection(("127.0.0.1", viewing.server.server_port))
    stream.sendall(f"GET /events HTTP/1.1\r\nHost: 127.0.0.1:{viewing.server.server_port}\r\n\r\n".encode())
    with stream, stream.makefile("rb") as lines:
        reported = b"".join(next(lines) for _ in range(20))
    assert b"token_header" in reported and token.encode() not in reported


def malformed(draw: random.Random, host: bytes, token: bytes) -> bytes:
    """A request with one to three things wrong, or one that asks for an upgrade and sends frames of a websocket."""
    lines = [b"GET / HTTP/1.1", b"Host: " + host, TOKEN_HEADER.encode() + b": " + token]
    body = b'{"do": "fly", "finger": 3}'
    others = [b"HEAD", b"PUT", b"OPTIONS", b"CONNECT", b"PRI", b"get", b"\0"]
    method = draw.choice([b"GET", b"POST", draw.choice(others)])
    paths = [b"/", b"/command", b"/events/..", b"/../server.py", b"/..%2fserver.py", b"//", b"*", b"\\..\\"]
    path = draw.choice([*paths, b"http://x/", b"\xff"])
    lines[0] = b" ".join([method, path, draw.choice([b"HTTP/1.1"] * 5 + [b"HTTP/1.0", b"HTTP/9.9", b"HTTP/x", b""])])
    wrong = [
        b"Content-Length: " + draw.choice([b"-1", b"9" * 5000, b"1e3", b"+5", b"1001", b"\xb2", b"5, 5", b"27"]),
        b"Transfer-Encoding: chunked", b"Expect: 100-continue", b"X: " + b"y" * draw.choice([1, 70_000, 1 << 20]),
        b"no colon", b" folded: 1", b"\0\x1b[2J: \xff", b"Host: example.org", b"Origin: null",
        TOKEN_HEADER.encode() + b": \xff\xe9", b"A0: 1", b"A1: 1", b"A2: 1",
        b"Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAA",
    ]  # fmt: skip
    lines += draw.sample(wrong, draw.randrange(3))
    if draw.random() < 0.1:
        lines += [b"B%d: 1" % k for k in range(200)]
    frames = [b"\x81\xfe\xff\xff", b"\xf1\x05hello", b"\x89\x7e\x00\x80" + bytes(128), b"\x81\x02\xc3\x28", b"\x00\x00"]
    text = draw.choice([b"\r\n"] * 3 + [b"\n"]).join(lines) + b"\r\n\r\n" + draw.choice([b"", body, *frames])
    kind = draw.randrange(8)
    if kind == 0:
        return text[: draw.randrange(len(text))]
    if kind == 1:
        return draw.randbytes(draw.choice([1, 300, 100_000]))
    return text


@pytest.mark.parametrize("tries", [300, pytest.param(10_000, marks=pytest.mark.nightly)])
def test_requests_that_are_none_are_refused_and_forgotten(make_player, view_of, capfd, tries: int) -> None:
    """Nothing of the page's is told but the page's files, nothing is done, no thread dies of it or stays."""
    player, draw = make_player(), random.Random(tries)
    viewing = view_of(lambda: player)
    host = f"127.0.0.1:{viewing.server.server_port}".encode()
    answers: Counter[bytes] = Counter()
    for k in range(tries):
        token = draw.choice([b"guess", viewing.server.token.encode()])
        with socket.create_connection(("127.0.0.1", viewing.server.server_port)) as connection:
            with contextlib.suppress(OSError):  # refused before all was read
                connection.sendall(malformed(draw, host, token))
                connection.shutdown(socket.SHUT_WR)
            got = b""
            with contextlib.suppress(OSError):
                while len(got) < 1 << 20 and (part := connection.recv(1 << 16)):
                    got += part
        # Without a head, as 0.9 had it, in words.
        reported = re.match(rb"HTTP/\S+ (\d+)", got) or re.search(rb"Error code: (\d+)", got)
        status = reported[1] if reported else b""
        answers[status] += 1
        known = {b"", b"100", b"200", b"400", b"403", b"404", b"409", b"414", b"431", b"501", b"505"}
        assert status in known, (k, got[:200])
        assert b"101 " not in got[:20] and viewing.server.token.encode() not in got and b"import " not in got
    assert ask(viewing, "GET", "/")[0] == 200 and player.commands == []
    assert min(answers[status] for status in (b"200", b"400", b"403", b"404", b"501")) > 0, answers
    assert capfd.readouterr().err == ""


def test_connections_that_drip_make_room(make_player, view_of) -> None:
    viewing = view_of(lambda: make_player())
    port = viewing.server.server_port
    dripping = []
    for _ in range(MAX_CONNECTIONS + 8):
        dripping.append(socket.create_connection(("127.0.0.1", port)))
        dripping[-1].sendall(b"GET / HTTP/1.1\r\nHost: ")
    assert ask(viewing, "GET", "/")[0] == 200
    answered = 0
    for connection in dripping:
        with contextlib.suppress(ConnectionError), connection:
            connection.sendall(f"127.0.0.1:{port}\r\n\r\n".encode())
            answered += connection.recv(1 << 16).startswith(b"HTTP/1.1 200")
    assert 0 < answered < MAX_CONNECTIONS


def test_pages_are_few(make_player, view_of) -> None:
    viewing = view_of(lambda: make_player())
    port = viewing.server.server_port
    pages = []
    for _ in range(MAX_PAGES):
        pages.append(socket.create_connection(("127.0.0.1", port)))
        pages[-1].sendall(f"GET /events HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
        assert pages[-1].recv(15) == b"HTTP/1.1 200 OK"
    assert ask(viewing, "GET", "/events")[0] == 503
    assert ask(viewing, "GET", "/")[0] == 200
    for page in pages:
        page.close()


def test_only_this_computer_is_served_and_only_the_pages_files(make_player, view_of) -> None:
    viewing = view_of(lambda: make_player())
    assert viewing.server.server_address[0] == "127.0.0.1"
    assert ask(viewing, "GET", "/")[0] == 200
    assert ask(viewing, "GET", "/", Host="rebound.example.org")[0] == 403
    assert ask(viewing, "GET", "/events", Host="rebound.example.org")[0] == 403
    for path in ("/../server.py", "/%2e%2e/server.py", "//etc/passwd", "/nothing"):
        assert ask(viewing, "GET", path)[0] == 404


def test_a_page_that_is_too_slow_misses_frames_and_is_told_how_many(make_player, touch) -> None:
    state = PageState("scripted")
    player = make_player()
    slow, quick = state.cursor(), state.cursor()
    rounds, got = 0, 0
    for _ in range(3):
        state.add(touch, player)
        rounds += len(touch.frames)
        got += min(len(touch.frames), KEPT_ROWS)
        state.wait(quick, 0)
    news = json.loads(state.wait(slow, 0))
    assert len(news["frames"]) == KEPT_ROWS
    assert news["dropped"] == rounds - KEPT_ROWS
    assert news["frames"][-1][FRAME_ROW.index("seq")] == touch.frames["seq"][-1]
    assert quick.dropped == rounds - got
    assert state.wait(slow, 0) == ""


def test_a_browser_that_reads_nothing_does_not_hold_the_reader(make_player, view_of, touch) -> None:
    player = make_player()
    viewing = view_of(lambda: player)
    stuck = socket.create_connection(("127.0.0.1", viewing.server.server_port))
    stuck.sendall(f"GET /events HTTP/1.1\r\nHost: 127.0.0.1:{viewing.server.server_port}\r\n\r\n".encode())
    cursor = viewing.state.cursor()
    rounds = 60
    for _ in range(rounds):
        player.script.put(touch)
    while cursor.frames < rounds * len(touch.frames):
        assert viewing.state.wait(cursor, 300.0)  # empty: the reader stands still
    stuck.close()


def test_events_are_marks_in_their_fingers_time(make_player, touch) -> None:
    event = wire.Event(3, int(touch.t_us[-1]) % 2**32, 1, 5, wire.EventKind.SLIP, 2, 0, 0, 99, 255)
    state = PageState("sim:")
    state.add(replace(touch, messages=[event]), make_player())
    health = json.loads(state.wait(state.cursor(), 1.0))["health"]
    assert health["events"] == [{"finger": 1, "t_us": int(touch.t_us[-1]), "name": "slip"}]


def test_rows_hold_the_wires_own_numbers(touch) -> None:
    touch = replace(touch, wire=touch.wire.copy())
    touch.wire["counts"][5, 3] = wire.INVALID_COUNT
    touch.wire["pdc"][5] = wire.INVALID_COUNT
    rows = [dict(zip(FRAME_ROW, json.loads(text), strict=True)) for text in frame_rows(touch)]
    signals = np.array([[np.nan if v is None else v / 16 for v in row["signal_q4"]] for row in rows])
    np.testing.assert_array_equal(signals, electrode_signals(touch.wire))
    assert rows[5]["signal_q4"][3] is None and rows[5]["pdc"] is None
    assert rows[0]["force_100un"] == [None] * 3 and rows[0]["map_um"] is None
    last = rows[-1]
    assert last["poc_um"] == touch.wire["poc_um"][-1].tolist()
    assert [r["seq"] for r in rows] == touch.frames["seq"].tolist()


def test_heartbeats_are_frames_without_signals() -> None:
    with biotac.open("sim:press.toml?seconds=3") as hand:
        hand.stream("force", rest=False)
        batch = hand.read_batch(10)
    batch.idle["pdc"][0] = wire.INVALID_COUNT
    rows = [dict(zip(FRAME_ROW, json.loads(text), strict=True)) for text in frame_rows(batch)]
    assert [row["pdc"] for row in rows if row["seq"] == batch.idle["seq"][0]] == [None]
    assert len(rows) == len(batch.frames) + len(batch.idle)
    assert [r["t_us"] for r in rows] == sorted(r["t_us"] for r in rows)
    assert {r["seq"] for r in rows if r["signal_q4"] is None} == set(batch.idle["seq"].tolist())


def test_a_tares_age_grows_between_two_status_messages() -> None:
    facts_ = {"tare_age_ms": 500, "status_t_us": 2**32 - 1_000_000, "t_us": 2**32 + 2_000_000}
    assert tared(2, facts_) == {"finger": 2, "tare_age_ms": 3500}
    assert tared(2, facts_ | {"t_us": 2**32 - 1_010_000})["tare_age_ms"] == 500


def player_of(folder: Path, source: str, pace: float) -> tuple[biotac.Recording, Player]:
    path = folder / "a.mcap"
    with biotac.open(source) as hand:
        recorder = hand.record(path)
        hand.read(10)
        recorder.close()
    recording = biotac.Recording(path)
    return recording, Player(shake_hands(ReplayLink(str(path), Playback(recording), pace=pace)), folder)


def test_a_recording_is_played_whole_and_once(tmp_path: Path) -> None:
    recording, player = player_of(tmp_path, "sim:press.toml?fingers=2&seconds=4", 40.0)
    batches = list(player.batches())
    player.close()
    frames = np.concatenate([b.frames for b in batches])
    assert frames.tobytes() == recording.frames.tobytes()  # NaN and all
    assert sum(len(b.pac) for b in batches) == len(recording.pac)
    assert not player.live and player.board.endswith(f", recorded from {recording.metadata['port']}")
    assert player.stats().frames == len(frames) and player.stats().frames_lost == 0


def test_a_paused_recording_stands_still_until_it_goes_on_or_is_closed(tmp_path: Path, view) -> None:
    recording, player = player_of(tmp_path, "sim:drift.toml?fingers=1&seconds=60", 1.0)  # it plays until it is paused
    player.do("pause", None)
    player.do("pace", None, 100.0)
    came, at_resume = [], []
    threading.Timer(0.5, lambda: (at_resume.append(sum(came)), player.do("resume", None))).start()
    came.extend(len(b.frames) for b in player.batches())
    assert at_resume[0] < sum(came) == len(recording.frames)
    with pytest.raises(biotac.InputError, match="a recording cannot be tared; open a board"):
        player.do("tare", 0)
    player.close()
    viewing = view(str(recording.path))
    assert viewing.reader.ask("pause", None) == "paused"
    viewing.close()


def test_a_command_after_a_seek_is_for_what_plays_from_there(tmp_path: Path) -> None:
    recording, player = player_of(tmp_path, "sim:drift.toml?fingers=1&seconds=60", 1.0)
    player.close()
    may_open = threading.Event()
    may_open.set()

    class Opener(RecordingOpener):
        def __call__(self) -> Player:
            assert may_open.wait(WAIT_S)
            return super().__call__()

    state = PageState("a recording")
    reader = PageReader(Opener(str(recording.path), tmp_path), state, again=False)
    reader.start()
    assert reader.ask("pause", None) == "paused"
    may_open.clear()
    reader.ask("seek", None, 30.0)
    with ThreadPoolExecutor(1) as pool:
        paused = pool.submit(reader.ask, "pause", None)
        may_open.set()
        assert paused.result() == "paused"
    until(lambda: health(state)["epoch"] == 2)
    assert health(state)["link"] == "paused"
    reader.stop()


def test_a_lost_board_refuses_commands_with_the_reason(view_of) -> None:
    def opener() -> None:
        raise biotac.PortError("no port /dev/ttyACM0")

    viewing = view_of(opener)
    with pytest.raises(biotac.InputError, match="No board: no port /dev/ttyACM0"):
        viewing.reader.ask("tare", 0)


def test_a_scenario_lasts_unless_it_says_how_long() -> None:
    assert lasting("sim:press.toml") == "sim:press.toml?seconds=120"
    assert lasting("sim:press.toml?fingers=2") == "sim:press.toml?fingers=2&seconds=120"
    assert lasting("sim:press.toml?seconds=2") == "sim:press.toml?seconds=2"
    assert lasting("sim:trial.npz") == "sim:trial.npz"
    assert lasting("/dev/ttyACM0") == "/dev/ttyACM0"


def test_a_browser_gets_every_file_and_all_fingers() -> None:
    assert fingers_shown("sim:press.toml?fingers=5&seconds=60") == set(range(5))


def test_a_taken_port_is_told(make_player, view_of, capsys) -> None:
    port = view_of(lambda: make_player()).server.server_port
    assert main(["view", "sim:press.toml", "--no-browser", "--port", str(port)]) == 3
    assert "use --port 0 for any free port" in capsys.readouterr().err


def test_many_events_hide_no_label(tmp_path: Path) -> None:
    """A whole hand's events are one mark, and the 500 first marks are not all."""
    with biotac.open("sim:press.toml?fingers=5&seconds=40") as hand, hand.record(tmp_path / "a.mcap"):
        hand.stream("results", "events")
        assert sum(isinstance(m, wire.Event) for batch in hand.batches() for m in batch.messages) > 300
    recording = biotac.Recording(tmp_path / "a.mcap")
    for k in range(500):
        recording.mark(f"note {k}")
    recording.mark("late", 39.0)
    marks = overview(recording)["marks"]
    assert "late" in [mark["name"] for mark in marks]
    assert len([mark for mark in marks if mark["name"] == "touch, finger 0 1 2 3 4"]) > 10


def test_closing_leaves_no_thread_behind(view) -> None:
    before = set(threading.enumerate())
    viewing = view("sim:drift.toml")
    viewing.close()
    assert not {t for t in set(threading.enumerate()) - before if not t.name.startswith("Thread-")}
