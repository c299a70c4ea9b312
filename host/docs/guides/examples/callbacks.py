"""Be called when a finger is touched and when batches arrive. python callbacks.py [PORT]"""

import sys

import numpy as np

import biotac

most_n = 0.0


def touched(touch) -> None:
    print(f"finger {touch.finger}: possible touch at {touch.t_us / 1e6:.4f} s")


def arrived(batch) -> None:
    global most_n
    for force_n in np.linalg.norm(batch.frames["force_n"], axis=1):
        most_n = max(most_n, force_n)  # NaN, where there is no force, is never larger


with biotac.open(sys.argv[1] if len(sys.argv) > 1 else "sim:press.toml") as hand:
    hand.on_touch(touched)
    stop = hand.on_batch(arrived)
    hand.stream()
    for _ in hand.batches():  # or any work of your own
        pass
    stop()

print(f"largest force {most_n:.2f} N")
