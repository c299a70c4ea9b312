"""A scale on a serial port: a pseudo-terminal that prints as scales do, asked or not."""

import json
import os
import select
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
from live_board import WAIT_S

from biotac.calibrate.reference.scale import SerialScale
from biotac.cli.main import main
from biotac.errors import InputError, PortError

G = 9.80665
PATIENCE_S = 0.6
ANSWER_S = 0.3  # by the clock of a test with a scale that never answers well


@contextmanager
def printing(lines: list[bytes], passed: Callable[[], object] = lambda: None) -> Iterator[str]:
    """The path of a scale that answers every request with the next of ``lines``, the last one again and again.

    ``passed`` is called after each answer.
    """
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    waiting, over = list(lines), threading.Event()

    def answer() -> None:
        asked = b""
        while not over.is_set():
            if not select.select([ours], [], [], 0.02)[0]:
                continue
            asked += os.read(ours, 64)
            if asked.endswith(b"\r\n"):
                asked = b""
                os.write(ours, waiting[0])
                del waiting[: len(waiting) > 1]
                passed()

    thread = threading.Thread(target=answer, daemon=True)
    thread.start()
    try:
        yield os.ttyname(theirs)
    finally:
        over.set()
        thread.join()
        os.close(theirs)
        os.close(ours)


@pytest.mark.parametrize(
    ("printed", "force_n"),
    [
        (b"S S     100.00 g\r\n", 0.1 * G),
        (b"ST,+00123.4  g\r\n", 0.1234 * G),
        (b"ST,GS,+  0.500kg\r\n", 0.5 * G),
        (b"ST,+0002.50  N\r\n", 2.5),
        (b"123.4  g\r\nST,+00200.0  g\r\n", 0.2 * G),  # begun in the middle of a line
        (b"US,+00400.0  g\r\nS D     300.0 g\r\nS S     250.0 g\r\n", 0.25 * G),
    ],
)
def test_what_scales_print_is_newtons(printed: bytes, force_n: float) -> None:
    with printing([printed]) as port, SerialScale(port, WAIT_S) as scale:
        assert scale.force_n() == pytest.approx(force_n)
        assert scale.force_n() == pytest.approx(force_n)


@pytest.mark.parametrize(
    ("printed", "message"),
    [
        (b"", "no data from the scale in 0.6 s"),
        (b"hello\r\n", "'hello' is not a weight"),
        (b"S D     100.00 g\r\n", "did not settle"),
        (b"S +\r\n", "the scale is out of range"),
        (b"OL,+9999999  g\r\n", "the scale is out of range"),
        (b"S S     10.00 oz\r\n", "expected a unit of N, g, kg"),
        (b"ST,+00000.0  g\r\n", "while a finger should press"),
        (b"ST,-00120.0  g\r\n", "while a finger should press"),
    ],
)
def test_what_is_no_reading_is_one_line(monkeypatch: pytest.MonkeyPatch, printed: bytes, message: str) -> None:
    """The reading's time is that of the answers, however long a busy computer takes for one."""
    answers: list[None] = []
    monkeypatch.setattr(time, "monotonic", lambda: ANSWER_S * len(answers))
    scale_of = printing([printed], lambda: answers.append(None))
    with scale_of as port, SerialScale(port, PATIENCE_S) as scale, pytest.raises(InputError) as refused:
        scale.force_n()
    assert message in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize("query", ["?baud=fast", "?baud=", "?speed=9600", "?parity=X"])
def test_a_form_that_is_not_known_is_refused(query: str) -> None:
    with pytest.raises(InputError, match="baud=9600"):
        SerialScale(f"/dev/null{query}")


def test_a_port_that_is_not_there_is_named() -> None:
    with pytest.raises(PortError, match="no port /dev/nowhere"):
        SerialScale("/dev/nowhere")


def test_a_scale_that_is_unplugged_is_told() -> None:
    with printing([b"S S 1 g\r\n"]) as port:
        scale = SerialScale(port)
    with scale, pytest.raises(PortError, match="lost the connection to the scale"):
        scale.force_n()


def test_a_calibration_reads_the_scale_at_every_press(capsys: pytest.CaptureFixture[str]) -> None:
    argv = ["calibrate", "press", "sim:fingers.toml?fingers=1&pace=fast", "--finger", "index", "--presses", "3"]
    shown = [b"S S     204.0 g\r\n", b"S S     357.0 g\r\n", b"S S     510.0 g\r\n"]
    with printing(shown) as port:
        assert main([*argv, "--json", "--scale", f"{port}?baud=9600"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["serial"] == "BTSIM00000000001" and not facts["refused"]
    assert facts["shown_n"] == pytest.approx([0.204 * G, 0.357 * G, 0.510 * G])


def test_what_was_shown_is_kept_when_the_scale_fails(capsys: pytest.CaptureFixture[str]) -> None:
    argv = ["calibrate", "press", "sim:fingers.toml?fingers=1&pace=fast", "--finger", "index", "--presses", "3"]
    with printing([b"S S     204.0 g\r\n", b"S S     357.0 g\r\n", b"S +\r\n"]) as port:
        assert main([*argv, "--scale", port]) == 2
    error = capsys.readouterr().err
    assert "the scale is out of range" in error
    assert "biotac calibrate press REC --scale --finger 0 --readings 2.001,3.501`, and those that are missing" in error
