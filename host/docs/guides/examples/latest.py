"""Look at fingers whenever you like; what is too old is not shown. python latest.py [PORT]"""

import sys
import threading

import biotac

with biotac.open(sys.argv[1] if len(sys.argv) > 1 else "sim:press.toml?pace=real&seconds=2", reconnect=True) as hand:
    hand.stream()
    tick = threading.Event()
    while hand.streaming:
        tick.wait(0.25)  # your own loop: a controller, a user interface
        finger = hand["index"]
        if finger.stale:
            print(f"no force: {finger.stale}")
            continue
        frame = finger.frame  # of one round: two properties of a finger may come from two
        print(f"force {frame.force_n} N at {frame.poc_mm} mm, {finger.age_s * 1e3:.0f} ms old, {frame.flags}")
