"""What the default map makes of 4 N on each electrode of five simulated fingers, as a Markdown table."""

from __future__ import annotations

import numpy as np

import biotac
from biotac.sim import SimFinger, Touch, world

REGIONS = {
    "the pad: E17, E18, E19": (17, 18, 19),
    "the tip: E7 to E10": (7, 8, 9, 10),
    "the sides: E1 to E6, E11 to E16": (1, 2, 3, 4, 5, 6, 11, 12, 13, 14, 15, 16),
}
FORCE_N, FINGERS = 4.0, range(1, 6)

felt = np.full((len(FINGERS), 20), np.nan)  # as a share of what was applied, by finger and electrode
outside = np.zeros_like(felt)
for row, seed in enumerate(FINGERS):
    with world({"index": SimFinger(seed)}) as w:
        w.run(3.0)
        for electrode in range(1, 20):
            for share in np.linspace(0.05, 1.0, 20):
                w.step(index=Touch(share * FORCE_N, at=f"E{electrode}"))
            for _ in range(15):
                now = w.step(index=Touch(FORCE_N, at=f"E{electrode}"))
            frame = now["index"].frame
            felt[row, electrode] = np.linalg.norm(frame.force_n) / FORCE_N
            outside[row, electrode] = biotac.FrameFlags.OUTSIDE in frame.flags
            w.run(1.5)

print("| 4 N on | felt, over applied: least | most | flagged `OUTSIDE` |\n| --- | --- | --- | --- |")
for name, electrodes in REGIONS.items():
    ratios = felt[:, electrodes]
    print(f"| {name} | {ratios.min():.1f} | {ratios.max():.1f} | {100 * outside[:, electrodes].mean():.0f} % |")
