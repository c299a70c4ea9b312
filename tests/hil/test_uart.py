"""The Pico's UART: the same wire for a hand's own controller, the C client among them, under any load of USB."""

import os
import select
import subprocess
from pathlib import Path

import pytest
from held_press import of_finger

import biotac
from biotac import CommandRefusedError, FaultFlags, FrameFlags, InputError, Setting
from biotac.doctor import diagnose
from biotac.doctor.listening import examine
from biotac.errors import StreamTakenError
from biotac.hand.opening import shake_hands
from biotac.link.serial_port import SerialLink
from biotac.sim.loading import load_source
from biotac.wire import messages_gen as wire
from biotac.wire.framing import encode, open_frame
from biotac_rig.emulated import EmulatedBoard, new_pty
from rig import Rig

CLIENT = Path(__file__).resolve().parents[2] / "firmware" / "client"
BAUD = 400_000  # FRAMEs of two fingers fit; with PAC they do not
FRAMES = 60
PATIENCE_S = 5  # of the board's time


class UartLink(SerialLink):
    """At the emulated pins; a board that is slower than board time is waited for."""

    patience = 60.0


def a_pico(rig: Rig, *, fingers: int, pace: float) -> EmulatedBoard:
    """Emulated, with the UART on a pty."""
    rig.need("uart")
    board = EmulatedBoard(
        rig.facts["board"], load_source("press.toml", fingers=fingers, seconds=900.0), pace=pace, hold=True, uart=True
    )
    rig.opened.append(board)
    board.release()
    return board


def save_rate(hand: biotac.Hand, bits_per_s: int) -> None:
    hand.board.set_setting(Setting.UART_BITS_PER_S, bits_per_s)
    hand.board.save_settings()


def test_the_same_wire_whatever_is_done_at_usb(rig: Rig, tmp_path: Path) -> None:
    # Board time runs by the clock while the client is compiled and awaited, and stands still behind the tape. Slowly:
    # a busy computer keeps a stream alive, and a HOLD.
    board = a_pico(rig, fingers=2, pace=0.5)
    with biotac.open(board.path) as hand:
        save_rate(hand, BAUD)
        assert board.counters()["uart"] is None  # not before the next start
    board.do("cut power")
    board.until(PATIENCE_S, uart={"sent": 0})
    the_client_prints_what_python_reads(board, tmp_path)
    with shake_hands(UartLink(board.uart_path, BAUD)) as hand:
        batch = hand.read_batch(0.3)
        assert len(batch.wire) == FRAMES and len(batch.pac) == 0  # only a subscriber gets PAC
        too_much = "carries 400000 bit/s, but FRAMES and PAC of 2 fingers take [0-9]+; stream at most 1 "
        with pytest.raises(InputError, match=too_much):
            hand.stream("results", "pac")
        with biotac.open(board.path) as other:
            assert other.info.boot_id == hand.info.boot_id
            assert other.status().streams == hand.status().streams != 0
            with pytest.raises(CommandRefusedError, match=r"LINK_BUSY.*--take-link of biotac flash and doctor"):
                other.read(0.1)
            hand.hold(0)
            board.do("open and close 1000 times")
            held = of_finger(hand.read(1.0, fresh=True), 0)  # a row that waited here was made before the HOLD
            assert (held["flags"][-FRAMES:] & FrameFlags.HELD).all() and hand.stats.frames_lost == 0
        found = diagnose(examine(board.path, seconds=0.5))
        assert [finding.code for finding in found] == ["refused"]
        assert "refused" not in [finding.code for finding in diagnose(examine(board.path, seconds=0.5, take_link=True))]
        with pytest.raises(StreamTakenError, match="the board's other port"):
            hand.read(2.0)
    with biotac.open(board.path) as other:
        assert (other.read(0.1)["flags"] & FrameFlags.HELD)[-2:].any()
        assert other.status().faults & FaultFlags.LINK_TAKEN
        other.release()
        other.board.clear_faults()
    with shake_hands(UartLink(board.uart_path)) as hand:  # which knows no limit
        status = hand.status()
        assert (status.messages_dropped, status.rx_errors, status.slots_late) == (0, 0, 0)
        hand.stream("results", "pac")
        hand.read(1.0)
        assert hand.stats.pac_lost > 0
        assert hand.stats.crc_errors == hand.stats.other_errors == 0  # whole messages
        hand.stop()
        status = hand.status()
        assert status.messages_dropped > 0 and status.faults & FaultFlags.DROPPED
    counters = board.counters()["uart"]
    assert counters["overruns"] == 0 and abs(counters["fastest_bits_per_s"] / BAUD - 1) < 0.005


@pytest.mark.parametrize("how", ["cut power", "lose interrupts"])
def test_the_first_frame_comes_within_150_ms_of_a_reset(rig: Rig, how: str) -> None:
    # So slow that asking for the board's time, and a busy computer, take none of it.
    board = a_pico(rig, fingers=5, pace=0.05)
    with biotac.open(board.path) as hand:
        save_rate(hand, 3_000_000)
    start = b"\0" + encode(wire.Start.ID, wire.Start(1, int(wire.StreamFlags.FRAMES), 31, 60_000).pack())
    for path, configured in ((board.uart_path, None), (board.path, "configured")):
        with open(path, "r+b", buffering=0) as port:
            os.set_blocking(port.fileno(), False)
            port.read()
            now = before = board.counters()
            board.send_line(how)
            while now["boots"] == before["boots"] or (configured and now["usb"]["state"] != configured):
                before, now = (now if now["boots"] == before["boots"] else before), board.counters()
            begun_s, came = (now if configured else before)["emulated_s"], b""
            port.write(start)
            while wire.FrameMessage.ID not in numbers(came):
                came += port.read() or b""
                ended_s = board.counters()["emulated_s"]
            print(f"{how}, {path}: first FRAME after {1000 * (ended_s - begun_s):.0f} ms")
            assert ended_s - begun_s < 0.15


def numbers(came: bytes) -> list[int]:
    """Numbers of the whole messages that a board sent."""
    opened = [open_frame(frame) for frame in came.split(b"\0") if frame]
    return [message[0] for message in opened if message is not None]


def the_client_prints_what_python_reads(board: EmulatedBoard, folder: Path) -> None:
    """firmware/client/example.c at the pins, and the same bytes again through Python's messages."""
    program = folder / "example"
    sources = [str(CLIENT / name) for name in ("example.c", "biotac_client.c")]
    subprocess.run(["cc", "-std=gnu11", *sources, "-o", str(program)], check=True)
    came = b""
    with new_pty() as (pty, path), open(board.uart_path, "r+b", buffering=0) as uart:
        os.set_blocking(uart.fileno(), False)
        held = os.open(path, os.O_RDWR | os.O_NOCTTY)  # so that the pty never hangs up
        with subprocess.Popen([str(program), path, str(FRAMES)], stdout=subprocess.PIPE, text=True) as running:
            while running.poll() is None:
                ready = select.select([pty, uart.fileno()], [], [], 0.05)[0]
                if pty in ready:
                    uart.write(os.read(pty, 4096))
                if uart.fileno() in ready and (data := uart.read(4096)):
                    came += data
                    os.write(pty, data)
            assert running.stdout is not None
            printed = [line.split() for line in running.stdout]
        os.close(held)
    assert running.returncode == 0
    messages = [message for frame in came.split(b"\0") if frame and (message := open_frame(frame)) is not None]
    frames = [wire.FrameMessage.unpack(payload) for number, payload in messages if number == wire.FrameMessage.ID]
    sent = [(f.finger, f.t_us, *f.force_100un, f.flags, f.trust) for f in frames[:FRAMES]]
    assert sent == [(*map(int, fields[:5]), int(fields[5], 16), int(fields[6])) for fields in printed]
    assert len(sent) == FRAMES
