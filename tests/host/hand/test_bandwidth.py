"""Messages that fit through a UART: by the lengths in schema.json, and as the Pico's page has it."""

import json
import re
from pathlib import Path

import pytest

from biotac.board import bandwidth
from biotac.wire.messages_gen import StreamFlags

ROOT = Path(__file__).resolve().parents[3]
COLUMNS = [StreamFlags.FRAMES | more for more in (StreamFlags(0), StreamFlags.PAC)]
WIDTHS = {"u8": 1, "i8": 1, "u16": 2, "i16": 2, "u32": 4, "i32": 4}


def on_the_line(name: str) -> int:
    """Bytes of a message: id, payload, CRC-32, COBS's one, delimiter."""
    message = json.loads((ROOT / "protocol/schema.json").read_text())["link"]["message"][name]
    return 1 + sum(WIDTHS[field["type"]] * field.get("count", 1) for field in message["fields"]) + 4 + 1 + 1


def test_it_is_ten_bits_a_byte_and_a_hundred_rounds_a_second() -> None:
    seconds = on_the_line("STATUS") + 5 * on_the_line("SENSOR_STATUS")
    assert bandwidth.bits_per_s(StreamFlags.FRAMES, 5) == 10 * 100 * 5 * on_the_line("FRAME")
    all_of_it = StreamFlags.FRAMES | StreamFlags.PAC | StreamFlags.STATUS
    a_round = on_the_line("FRAME") + on_the_line("PAC")
    assert bandwidth.bits_per_s(all_of_it, 5) == 10 * (100 * 5 * a_round + seconds)


def test_the_picos_page_has_the_table() -> None:
    page = (ROOT / "firmware/boards/pico/README.md").read_text()
    rows = [tuple(map(int, row)) for row in re.findall(r"^\| (\d+) \| (\d) \| (\d) \|$", page, re.M)]
    assert len(rows) == 7
    for baud, *fits in rows:
        assert fits == [bandwidth.most_fingers(streams | StreamFlags.STATUS, baud) for streams in COLUMNS]


@pytest.mark.parametrize("fingers", range(6))
def test_what_fits_to_the_bit_is_not_refused(fingers: int) -> None:
    bandwidth.check("uart:X", bandwidth.bits_per_s(StreamFlags.FRAMES, fingers), StreamFlags.FRAMES, fingers)
