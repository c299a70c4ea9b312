"""The emulated Pico's file for a logic analyser: sigrok decodes the counts and the bytes of the FRAMEs at the UART."""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from biotac.wire.decoder import Decoder
from bus_picture import BITS_PER_S, draw, read_vcd, record, slots_ns

PRODUCT_MANUAL_SETTLE_NS = 50_000
PINS_SETUP_NS, PINS_HOLD_NS = 1800, 230  # firmware/boards/pico/pico_pins.h


def sigrok(path: Path, *options: str) -> bytes:
    command = ["sigrok-cli", "-i", str(path), "-I", "vcd:downsample=28", *options]  # 4 samples a half bit
    return subprocess.run(command, check=True, capture_output=True).stdout


@pytest.mark.nightly
@pytest.mark.usefixtures("emulated_pico")
def test_an_analyser_reads_the_sensors_words_and_the_uart(tmp_path: Path) -> None:
    path = tmp_path / "bus.vcd"
    frames = record(path, fingers=2)
    for finger in range(2):
        spi = f"spi:clk=SCK:miso=MISO:mosi=MOSI:cs=SS{finger}:wordsize=16"
        words = sigrok(path, "-P", spi, "-B", "spi=miso")
        levels = read_vcd(path)[f"SS{finger}"][1]
        assert len(words) // 2 == (np.diff(levels) > 0).sum() > 100  # also the file's last, which ends with it
        # A word has 7 + 5 bits of count beside parity.
        word = np.frombuffer(words[: len(words) // 2 * 2], ">u2")
        counts = ((word >> 9) * 32 + (word >> 3 & 31)).astype(np.uint16)
        finger_frames = frames[frames["finger"] == finger]
        rounds = [np.uint16([row["pdc"], row["tac"], row["tdc"], *row["counts"]]) for row in finger_frames]
        # A slot has the command, with a meaningless answer, and the read; every second sample is PAC. The recording
        # may begin between any of them.
        others = [counts[first::4] for first in range(4)]
        seen = [one for one in rounds if any(one.tobytes() in some.tobytes() for some in others)]
        assert len(seen) > 3
    sent = sigrok(path, "-P", f"uart:rx=TX:baudrate={BITS_PER_S}", "-B", "uart=rx")
    decoded = Decoder().feed(b"\0" + sent[sent.index(b"\0") :]).frames
    came = [row.tobytes() for row in frames]
    assert len(decoded) > 4 and sum(row.tobytes() in came for row in decoded) > 4

    lines = read_vcd(path)
    ss_ns, levels = lines["SS0"]
    sck_ns, clock = lines["SCK"]
    begin = slots_ns(lines)[2:-2]
    for start in begin:
        fell = ss_ns[(levels == 0) & (ss_ns > start)][0]
        rose = ss_ns[(levels == 1) & (ss_ns > fell)][0]
        ticks = sck_ns[(sck_ns > fell) & (sck_ns < rose)]
        assert len(ticks) == 32
        assert ticks[0] - fell >= PINS_SETUP_NS and rose - ticks[-1] >= PINS_HOLD_NS
        command_over = sck_ns[(sck_ns > start) & (clock == 0)][15]
        assert ticks[0] - command_over >= PRODUCT_MANUAL_SETTLE_NS
    draw(lines, tmp_path / "bus.png")
    assert (tmp_path / "bus.png").stat().st_size > 10_000
