"""Ask only for what you need: force, thinned to 20 a second, and silence at rest. python subscription.py [PORT]"""

import sys

import biotac

with biotac.open(sys.argv[1] if len(sys.argv) > 1 else "sim:press.toml", fingers={"thumb": 0}) as hand:
    hand.stream("force", rest=False, rate_hz=20)
    for batch in hand.batches():
        for frame in batch.frames:
            print(f"{frame['t_us'] / 1e6:7.3f} s  {frame['force_n']} N")
    print(f"at the end the thumb was {'touched' if hand['thumb'].touched else 'at rest'}")
