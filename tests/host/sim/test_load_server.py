"""Loads from a program in any language: lines of JSON, each answered once."""

import json
import socket
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import pytest
from live_board import WAIT_S

import biotac
from biotac.board.recovery import LOOK_S, LOOKS_WITHOUT_ROWS
from biotac.cli.main import main
from biotac.sim import SimFinger
from biotac.sim.board import SimBoard
from biotac.sim.live import LiveFingers
from biotac.sim.load_server import LINE_BYTES, LoadServer
from biotac.sim.serve import Served

PRESS = {"normal_n": 1.0}


@pytest.fixture
def live() -> Iterator[tuple[LoadServer, biotac.Hand]]:
    fingers = LiveFingers({"index": SimFinger(1), "thumb": SimFinger(2)})
    board = SimBoard(fingers.at_rest(), pace=0.0, live=True)
    port = Served(board)
    server = LoadServer(fingers, board)

    def serve() -> None:
        with suppress(OSError):  # it stops listening at the end
            server.serve()

    serving = threading.Thread(target=serve)
    serving.start()
    with biotac.open(port.path) as hand:  # the board waits for this reader
        hand.stream("results")
        hand.on_batch(lambda batch: None)
        yield server, hand
        server._listening.shutdown(socket.SHUT_RDWR)
        serving.join()
    port.close()
    board.close()


@pytest.fixture
def server(live: tuple[LoadServer, biotac.Hand]) -> LoadServer:
    return live[0]


def connected(server: LoadServer) -> socket.socket:
    program = socket.create_connection(("127.0.0.1", server.port))
    program.sendall(server.token.encode() + b"\n")
    return program


def answers(server: LoadServer, *lines: bytes) -> list[dict[str, Any]]:
    with connected(server) as program, program.makefile("rwb") as file:
        file.write(b"".join(line + b"\n" for line in lines))
        file.flush()
        program.shutdown(socket.SHUT_WR)
        return [json.loads(line) for line in file]


def fault(**given: Any) -> dict[str, Any]:
    return {"fault": {"finger": "index", **given}}


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (fault(), "with finger, kind"),
        (fault(knd="electrode open"), "with finger, kind"),
        (fault(kind="electrode open", at=3), "with finger, kind"),
        (fault(kind="electrode open") | {"thumb": PRESS}, "expected it alone"),
        ({"fault": None}, "with finger, kind"),
        (fault(kind=["x"]), "expected texts"),
        (fault(kind="nope"), "no fault 'nope'"),
        ({"index": {"course": [PRESS], "normal_n": 3}}, "a touch is"),
        ({"index": {"course": [{"course": [PRESS]}]}}, "a load has a Course, expected"),
        ({"index": [{"celsius": 10}, {"celsius": 50}]}, "celsius [10, 50]"),
        ({"ring": PRESS}, "no finger 'ring', expected one of index, thumb"),
        ({"index": {"at": "E" * LINE_BYTES}}, "longer than"),
    ],
)
def test_a_line_that_is_no_load_is_answered_once_in_words(server: LoadServer, wrong: Any, words: str) -> None:
    first, *others = answers(server, json.dumps(wrong).encode(), b"\xff\xfe", b"{}")
    assert words in first["error"] and "decode" in others[0]["error"] and others[1:] == [{"round": 1}]


def test_a_program_that_vanishes_makes_room_for_the_next(server: LoadServer) -> None:
    for _ in range(5):
        program = connected(server)
        program.sendall(b"{}\n" * 50)
        program.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        program.close()
    (answer,) = answers(server, b"{}")
    assert answer["round"] >= 1


def test_loads_from_lines_and_from_a_scenario_are_refused_together(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sim", "press.toml", "--live", "index"]) == 2
    assert "--live takes its loads from lines, and no SOURCE; drop press.toml" in capsys.readouterr().err


@pytest.mark.parametrize("names", ["index,index", "index,fault"])
def test_names_that_a_line_could_not_tell_apart_are_refused(names: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sim", "--live", names]) == 2
    assert "expected different names" in capsys.readouterr().err


def test_a_hand_at_the_boards_path_shows_what_the_loads_make_and_waits_while_none_come(
    live: tuple[LoadServer, biotac.Hand],
) -> None:
    """Time that goes by whole rounds, as fast as they come, is no clock: it runs ahead of the hand's keep-alive."""
    server, hand = live
    for stands_still_s in (0.0, 2 * LOOKS_WITHOUT_ROWS * LOOK_S):
        time.sleep(stands_still_s)
        program = threading.Thread(target=answers, args=(server, *[b"{}"] * 400))
        program.start()
        assert hand.next_round(timeout_s=WAIT_S)["index"].frame
        program.join()
        assert not hand["index"].stale
