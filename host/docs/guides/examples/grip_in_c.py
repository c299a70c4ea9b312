"""grip.c as a law that Python can call: biotac-lab grasp --law grip_in_c.py. It needs cc and a clone's C client.

The law gets each round as the bytes that a gateway sends, and runs with the session of example_bare.c around it.
"""

import ctypes
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from biotac import EventKind
from biotac.wire import DTYPES, encode, messages

HERE = Path(__file__).resolve().parent
CLIENT = HERE.parents[3] / "firmware/client"
CHIP = """
#include "GRIP"
static const unsigned char *next, *end;
static float state[6];
static uint32_t ms;
int uart_next(void) { return next < end ? *next++ : -1; }
void uart_send(const uint8_t *data, size_t bytes) { state[5] += bytes != 0 && data[1] == BT_RELEASE_ID; }
uint32_t now_ms(void) { return ms; }
void close_at(float mm_s) { state[0] = mm_s; }
void hand_poll(void);
const float *chip_round(const unsigned char *data, int bytes)
{
    next = data; end = data + bytes; ms += 10;
    hand_poll(); grip_round();
    state[1] = grip.normal_n; state[2] = grip.holds; state[3] = grip.settled; state[4] = grip.slips;
    return state;
}
"""


def built() -> ctypes.CDLL:
    """grip.c with the functions of a chip."""
    with tempfile.TemporaryDirectory() as folder:
        chip, made = Path(folder) / "chip.c", str(Path(folder) / "grip.so")
        chip.write_text(CHIP.replace("GRIP", str(HERE / "grip.c")))
        sources = [str(chip), str(Path(__file__).with_name("example_bare.c")), str(CLIENT / "biotac_client.c")]
        subprocess.run(["cc", "-O2", "-shared", "-fPIC", f"-I{CLIENT}", *sources, "-lm", "-o", made], check=True)
        library = ctypes.CDLL(made)
    library.chip_round.restype = ctypes.POINTER(ctypes.c_float)
    return library


LIBRARY = built()


def sent(message, **fields) -> bytes:
    """A message as a gateway sends it; fields that are not given are 0."""
    row = np.zeros(1, DTYPES[message.ID])
    for name, value in fields.items():
        row[name] = value
    return encode(message.ID, row.tobytes())


class Grip:
    """See biotac.grip; two fingers that meet along z, one grip at a time."""

    def __init__(self, towards=None, shares=None, least_n=0.8, most_n=12.0) -> None:
        self.speed_mm_s, self.normal_n, self.holds, self.settled, self.slips = [0.0] * 5
        LIBRARY.grip_begin(ctypes.c_float(least_n), ctypes.c_float(most_n))

    def step(self, frames, slipped: bool) -> float:
        """See biotac.grip."""
        data = sent(messages.Event, kind=EventKind.SLIP) if slipped else b""
        for frame, finger in zip(frames, (0, 4), strict=True):  # FINGERS of grip.c
            if frame is not None:
                force = np.where(np.isfinite(frame.force_n), np.rint(frame.force_n * 1e4), -(2.0**31))
                halves = np.nan_to_num(np.rint([frame.normal_half_n * 1e3, frame.shear_half_n * 1e3]), nan=65535)
                more = dict(zip(("normal_half_mn", "shear_half_mn"), halves, strict=True))
                more |= {"flags": int(frame.flags), "trust": frame.trust, "slip_level": frame.slip_level}
                data += sent(messages.FrameMessage, finger=finger, force_100un=force, **more)
        state = LIBRARY.chip_round(data, len(data))
        self.speed_mm_s, self.normal_n, self.holds, self.settled, self.slips = state[:5]
        return self.speed_mm_s
