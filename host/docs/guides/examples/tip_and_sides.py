"""The default map's force under loads on each electrode of five simulated fingers, as a Markdown table."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

import biotac
from biotac.sim import SimFinger, SimTouch, world

REGIONS = {
    "the pad: E17, E18, E19": (17, 18, 19),
    "the tip: E7 to E10": (7, 8, 9, 10),
    "the sides: E1 to E6, E11 to E16": (1, 2, 3, 4, 5, 6, 11, 12, 13, 14, 15, 16),
}
LOADS_N, FINGERS = (1.0, 2.0, 4.0, 8.0), range(1, 6)

felt = np.full((len(LOADS_N), len(FINGERS), 20), np.nan)  # over the applied force, by load, finger and electrode
outside = np.zeros_like(felt)
for row, seed in enumerate(FINGERS):
    with world({"index": SimFinger(seed)}) as w:
        w.run(3.0)
        for electrode in range(1, 20):
            for load, (before_n, force_n) in enumerate(pairwise((0.0, *LOADS_N))):
                for press_n in np.arange(before_n, force_n, 0.2):  # 20 N/s
                    w.step(index=SimTouch(press_n, at=f"E{electrode}"))
                now = w.run(0.15, index=SimTouch(force_n, at=f"E{electrode}"))
                frame = now["index"].frame
                felt[load, row, electrode] = np.linalg.norm(frame.force_n) / force_n
                outside[load, row, electrode] = biotac.FrameFlags.OUTSIDE in frame.flags
            w.run(1.5)

print(f"| felt, over applied | {' | '.join(f'{n:g} N' for n in LOADS_N)} | flagged `OUTSIDE` |")
print(f"|{' --- |' * (len(LOADS_N) + 2)}")
for name, electrodes in REGIONS.items():
    spans = [f"{ratios.min():.1f} to {ratios.max():.1f}" for ratios in felt[:, :, electrodes]]
    print(f"| {name} | {' | '.join(spans)} | {100 * outside[:, :, electrodes].mean():.0f} % |")
