"""Figures of how the boards behave, where the pages have them and where the code does."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SAFETY, PICO = "host/docs/reference/safety.md", "firmware/boards/pico/README.md"
SPEC, LINK = "protocol/SPEC.md", "protocol/link.toml"
SYSTEM, CONTROLLER = "firmware/port/rp2040/system.c", "firmware/port/rp2040/usb/controller.c"
WORDS = {"two": 2.0, "ten": 10.0}
#: A page and its words, a file of the code and its own, and how many of the code's make one of the page's.
FIGURES = [
    (SAFETY, r"the firmware hangs .*TARE_RESTORED.* (\d+) s, an exception", SYSTEM, r"WATCHDOG_US (\d+)u", 1e6),
    (SAFETY, r"the firmware hangs .* (\d+) s, an exception", "firmware/port/rp2040/boot2.S", r"=2 \* (\d+)", 1e6),
    (SAFETY, r"the firmware hangs .* (\d+) s, an ", "firmware/port/stm32f405/clocks.c", r"RLR = (\d+)", 32000 / 64),
    (PICO, r"restarts the board after (\w+) seconds", SYSTEM, r"WATCHDOG_US (\d+)u", 1e6),
    ("firmware/boards/f405/README.md", r"after (\w+) seconds", "firmware/port/stm32f405/clocks.c", r"RLR = (\d+)", 500),
    ("firmware/port/README.md", r"a halt of (\w+) seconds", SYSTEM, r"WATCHDOG_US (\d+)u", 1e6),
    (SAFETY, r"no start of frame for (\d+) ms", CONTROLLER, r"SUSPENDED_US +(\d+)u", 1e3),
    (PICO, r"hears no frame for (\d+) ms", CONTROLLER, r"HEARS_NOTHING_US (\d+)u", 1e3),
    (SAFETY, r"hold_timeout_ms` \| 1 s; (\d+) s", LINK, r"hold_timeout_ms\](?s:.*?)default = ([\d_]+)", 1e3),
    (SPEC, r"\(after (\w+) times", "firmware/core/talk/sensors.c", r"LATE_AFTER +(\d+)", 1),
]


@pytest.mark.parametrize(("page", "words", "code", "constant", "unit"), FIGURES)
def test_a_page_has_the_codes_figure(page: str, words: str, code: str, constant: str, unit: float) -> None:
    told = re.search(words, (ROOT / page).read_text(encoding="utf-8"))
    done = re.search(constant, (ROOT / code).read_text(encoding="utf-8"))
    assert told is not None and done is not None, (told, done)
    assert (WORDS.get(told[1]) or float(told[1])) == float(done[1].replace("_", "")) / unit
