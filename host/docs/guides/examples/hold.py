"""Hold a simulated thing: 1 N/mm, friction 0.5; in the third second it gets a weight of 1 N."""

from biotac import EventKind
from biotac.grip import Grip
from biotac.sim import SimFinger, SimTouch, world

FRICTION = 0.5
grip, closed_mm, slid_mm, slid_mm_s = Grip(), 0.0, 0.0, 0.0
with world({"index": SimFinger(11), "thumb": SimFinger(12)}) as hand:
    for seconds, touch_n in (7.0, 0.0), (0.5, 1.0), (0.5, 0.0):  # once they have let go, their tares are sure
        hand.run(seconds, index=SimTouch(touch_n), thumb=SimTouch(touch_n))
    for k in range(400):
        closed_mm += grip.speed_mm_s * 0.01
        press_n, weight_n = max(closed_mm - 2.0, 0.0), min(max(k - 200, 0) / 100, 1.0)
        pull_n = min(weight_n / 2, FRICTION * press_n)  # of each finger; the excess makes it fall, 0.1 kg of it
        slid_mm_s = max(slid_mm_s + (weight_n / 2 - FRICTION * press_n) / 0.05 * 1e3 * 0.01, 0.0)
        slid_mm += slid_mm_s * 0.01
        index, thumb = (SimTouch(press_n, (0.0, side * pull_n), slip_mm_s=slid_mm_s) for side in (-1, 1))
        now = hand.step(index=index, thumb=thumb)
        grip.step([now[name].frame for name in now], any(e.kind == EventKind.SLIP for e in now.events))
need_n = weight_n / 2 / FRICTION
print(f"holds {weight_n:.1f} N of weight with {press_n:.1f} N, where friction needs {need_n:.1f} N; ", end="")
print(f"{grip.slips} slips, {slid_mm:.1f} mm; it feels {grip.normal_n:.1f} N")
