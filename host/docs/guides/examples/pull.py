"""Read when you ask, one thread. python pull.py [PORT]"""

import sys

import biotac

with biotac.open(sys.argv[1] if len(sys.argv) > 1 else "sim:press.toml") as hand:
    frames = hand.read(seconds=3.0)

print(f"{len(frames)} frames, {frames['t_us'][-1] / 1e6:.2f} s")
