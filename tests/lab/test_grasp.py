"""`biotac-lab grasp`: the plant against statics, slides counted by hand, a run that goes on, and a failing check."""

import ctypes
import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from biotac import Finger, Frame, FrameFlags, TareState, Trust
from biotac.grip import Grip, GripState, constants
from biotac.sim import SimFinger, SimTouch
from biotac.sim.live import LiveFingers
from biotac.wire import DTYPES, messages, slots
from biotac_lab.cli import main
from biotac_lab.grasp import law, runs
from biotac_lab.grasp.felt import Board, TrueForce
from biotac_lab.grasp.lagging_plant import LaggingPlant
from biotac_lab.grasp.plant import KINETIC, ROUND_S, SKIN_N_PER_MM, Item, Plant, items
from biotac_lab.grasp.runs import Case
from biotac_lab.grasp.trial import Slides

ITEM = Item(mass_kg=0.2, friction=0.5, stiffness=5.0, added_kg=0.1, knock_n=1.0, limit_n=50.0)
WEIGHT_N = 0.2 * 9.81
CASE = Case("true", "", 0, 7, "numpy", 2, "new", "E17", "")
IN_C = Path(__file__).resolve().parents[2] / "host/docs/guides/examples/grip_in_c.py"


def lifted(press_n: float) -> Plant:
    """THING pressed with so much and lifted by 20 mm."""
    plant = Plant(ITEM)
    while plant.normal_n < press_n:
        plant.step(2.0, 0.0)
    for _ in range(10):
        plant.step(0.0, 0.0)  # the actuators come to rest
    for _ in range(200):
        plant.step(0.0, 10.0)
    return plant


def test_a_thing_is_lifted_where_friction_bears_it() -> None:
    need_n = WEIGHT_N / (2 * 0.5)
    held = lifted(1.05 * need_n)
    assert held.in_air and held.slid_mm == 0.0 and held.need_n == pytest.approx(need_n)
    assert held.touch(0)[1] == pytest.approx(WEIGHT_N / 2)
    assert not lifted(0.9 * need_n).in_air


def test_a_slide_is_that_of_coulombs_friction() -> None:
    plant = lifted(1.5 * WEIGHT_N)
    plant.extra_kg = 0.8  # more than friction bears
    friction_n, mass_kg = 2 * 0.5 * plant.normal_n * KINETIC, 1.0
    for _ in range(3):
        plant.step(0.0, 0.0)
    fallen_mm = 500 * (9.81 - friction_n / mass_kg) * (3 * ROUND_S) ** 2
    assert plant.slid_mm == pytest.approx(fallen_mm, rel=0.1)  # steps of 1 ms


def test_the_things_are_the_same_however_many_and_within_what_is_said() -> None:
    made = items(50, 7)
    assert made[:20] == items(20, 7) != items(20, 8)
    for item in made:
        worst_n = (item.mass_kg + item.added_kg) * 9.81 / (2 * item.friction)
        assert 0.05 <= item.mass_kg <= 0.4 and 0.35 <= item.friction <= 0.9 and 0.8 <= item.stiffness <= 30
        assert 1.6 <= item.limit_n / max(worst_n, 0.8) <= 4


def test_slides_and_slips_are_counted() -> None:
    slides = Slides()
    rows = ["S", "St", "Stu", "", "t", *[""] * 12, "t", *[""] * 12, "S", *[""] * 12, "S", "S", "tu"]
    for k, row in enumerate(rows):
        slides.round(k, "S" in row, "t" in row, "u" in row)
    expected = {"reported": 5, "used": 2, "false": 1, "slides": 3, "missed": 1, "reaction_ms": [20, 20]}
    assert slides.facts() == expected


def test_the_law_stays_where_nothing_is_known_and_believes_strong_slips() -> None:
    grip, plant, sense = Grip(), Plant(ITEM), TrueForce(2)
    speed = 10.0
    for _ in range(150):
        plant.step(speed, 0.0)
        frames, _ = sense.feel(plant)
        speed = grip.step(frames, False)
    assert grip.holds and grip.normal_n == pytest.approx(0.8, rel=0.06)

    def sheared(shear_n: float, level: int) -> list[Frame]:
        return [replace(f, force_n=np.add(f.force_n, [0.0, shear_n, 0.0]), slip_level=level) for f in frames]

    for level, slipped, slips in ((15, True, 0), (255, False, 0), (0, False, 0), (60, False, 0), (60, True, 1)):
        grip.step(sheared(0.3, level), slipped)  # as a squeeze shakes; not judged; nothing; too late; a slip
        assert grip.slips == slips
    assert grip.needed_n(0.6) == pytest.approx(2 * grip.normal_n)  # twice the shear, twice the force
    assert grip.speed_mm_s > 0
    grip.step(sheared(0.3, 60), True)
    assert grip.slips == 1  # the grip's squeeze
    for _ in range(10):
        grip.step(sheared(0.1, 0), False)
    grip.step(sheared(0.15, 60), True)
    assert grip.slips == 2  # also at half of the shear at which it slipped: the learnt value may be wrong
    for half_n, more in ((0.0, 2.0), (0.3 / 0.45, 2**0.5), (20.0, 1.0)):  # a doubtful force says hardly anything
        doubted = [replace(f, shear_half_n=half_n) for f in sheared(0.3, 60)]
        for _ in range(10):
            grip.step([replace(f, slip_level=0) for f in doubted], False)
        grip.slips = 0
        grip.step(doubted, True)
        assert grip.needed_n(0.6) / grip.needed_n(0.3) == pytest.approx(more, rel=1e-3)
    for trust, off_n in ((Trust.ACT, 0.0), (Trust.INTERVAL, 0.4)):
        for _ in range(60):
            grip.step([replace(f, trust=trust, normal_half_n=0.8) for f in frames], False)
        assert grip.normal_n - frames[0].force_n[2] == pytest.approx(off_n, abs=0.01)
    for _ in range(3):
        grip.step(frames, False)
        ways_mm = [0.01 * grip.step([None, None], False) for _ in range(80)]
        assert grip.state is GripState.BLIND and ways_mm[:2] == ways_mm[-20:-18] == [0.0, 0.0] and ways_mm[-1] == 0.0
        pressed_n = min(grip.normal_n, grip.wanted_n)
        harder_n = 1.4 * pressed_n + min(4 * grip.margin_n, pressed_n) - grip.normal_n  # by an interval's width
        assert harder_n > 0.4 and sum(ways_mm) * grip.stiffness == pytest.approx(harder_n, abs=0.05)  # once
    grip.step(frames, False)
    grip.most_n = grip.normal_n + 0.09
    blind_n = sum(0.01 * grip.step([None, None], False) for _ in range(40)) * grip.stiffness
    assert blind_n == pytest.approx(0.09, abs=0.05)


@pytest.mark.parametrize("trust", [Trust.HOLD, Trust.NONE, Trust.ACT])
def test_a_force_that_is_not_to_be_acted_on_freezes_the_hand(trust: Trust) -> None:
    (frame, _), _ = TrueForce(2).feel(Plant(ITEM))
    held = replace(frame, force_n=np.array([0.0, 0.5, 2.0]), flags=FrameFlags.CONTACT)
    grip, unsure = Grip(), replace(held, trust=trust, force_n=np.full(3, math.nan if trust == Trust.ACT else 9.0))
    assert grip.step([unsure, unsure], False) == 0.0 and not grip.holds  # it does not close either
    free = replace(held, force_n=np.zeros(3), flags=FrameFlags(0))
    unfelt = replace(free, flags=FrameFlags.LEAP_PENDING)
    assert Grip().step([free, unfelt], False) == 0.0 < Grip().step([free, free], False)
    for _ in range(20):
        grip.step([held, held], False)
    assert grip.step([held, held], False) < 0.0  # it presses more than it needs
    assert {grip.step([unsure, None], False) for _ in range(200)} == {0.0} and grip.state is GripState.FROZEN


def sheared(shear_n: float, level: int = 0, normal_n: float = 2.0) -> list[Frame]:
    (frame, _), _ = TrueForce(2).feel(Plant(ITEM))
    force_n = np.array([0.0, shear_n, normal_n])
    return [replace(frame, force_n=force_n, flags=FrameFlags.CONTACT, trust=Trust.ACT, slip_level=level)] * 2


def test_one_event_is_one_reflex() -> None:
    """As the board reports a knock: SLIP five times in a tenth of a second, while the press grows."""
    grip = Grip()
    for _ in range(60):
        grip.step(sheared(0.8), False)
    for k in range(10):
        grip.step(sheared(0.8, 60 * (k % 2 == 0), 2.0 + 0.06 * k), k % 2 == 0)
    assert grip.slips == 1 and grip.wanted_n == pytest.approx(1.3 * 2.0, rel=0.01) and grip.state is GripState.HOLDING
    for _ in range(constants.EVENT_ROUNDS):
        grip.step(sheared(0.8), False)
    grip.step(sheared(0.8, 60), True)
    assert grip.slips == 2 and grip.state is GripState.REFLEX


@pytest.mark.parametrize("met_n", [0.2, -0.7])
def test_who_puts_a_thing_down_does_not_squeeze_it(met_n: float) -> None:
    """It slides as it meets the table, which takes the weight and pushes against it."""
    grip = Grip()
    for _ in range(100):
        grip.step(sheared(0.8), False)
    speeds = [grip.step(sheared(met_n, 60), True) for _ in range(15)]
    assert grip.slips == 0 and max(speeds[3:]) <= 0.0


@pytest.mark.parametrize("lag_s", [0.012, 0.02, 0.03, 0.05])
@pytest.mark.parametrize("stiffness", [0.8, 3.0, 30.0])
def test_stiffness_is_learnt_with_the_actuators_lag_in_it(lag_s: float, stiffness: float) -> None:
    """Too stiff by half lets things drop."""
    plant, grip, sense = LaggingPlant(replace(ITEM, stiffness=stiffness), lag_s), Grip(), TrueForce(2)
    for k in range(400):
        plant.step(grip.speed_mm_s, 1.0 if k > 200 else 0.0)
        frames, slipped = sense.feel(plant) or ([], False)
        grip.step(frames, slipped)
    assert 0.65 < grip.stiffness * (2 / SKIN_N_PER_MM + 1 / stiffness) < 1.5


def test_the_constants_are_the_same_in_c() -> None:
    in_c = dict(re.findall(r"^#define (\w+) +([\d.]+)f?$", IN_C.with_name("grip.c").read_text(), re.M))
    own = {name: value for name, value in vars(constants).items() if isinstance(value, (int, float))}
    assert {name: float(value) for name, value in in_c.items()} == own


def test_the_law_neither_stops_nor_ratchets_where_rounds_are_missing() -> None:
    """A hand's clock beats against the board's: three rounds of sixteen without a frame, of a thing of 1 N/mm."""
    (frame, _), _ = TrueForce(2).feel(Plant(ITEM))
    grip, way_mm, most_n = Grip(), -3.0, 0.0
    for k in range(3000):
        press_n = max(way_mm, 0.0)
        flags = FrameFlags.CONTACT if press_n > 0.05 else FrameFlags(0)
        shown = replace(frame, force_n=np.array([0.0, 0.0, press_n]), flags=flags, trust=Trust.ACT)
        way_mm += 0.01 * grip.step([None, None] if k % 16 < 3 else [shown, shown], False)
        most_n = max(most_n, press_n)
    assert grip.holds and 0.7 < press_n < most_n < 1.5
    grip = Grip()
    pressed = replace(frame, force_n=np.array([0.0, 0.0, 30.0]), flags=FrameFlags.CONTACT, trust=Trust.ACT)
    assert (
        grip.step([pressed, replace(frame, flags=FrameFlags(0), trust=Trust.ACT)], False) == 0.0
    )  # one alone is pressed


def test_a_slip_is_pressed_and_learnt_where_no_force_is_known_when_it_is_told() -> None:
    """As after a restart, of 1 N/mm and a hand that lags by 50 ms: the board tells slips before the tare is back."""
    (frame, _), _ = TrueForce(2).feel(Plant(ITEM))
    grip, way_mm, moves_mm_s = Grip(), 0.0, constants.CLOSING_MM_S

    def step(trust: Trust, slipped: bool = False) -> float:
        nonlocal way_mm, moves_mm_s
        level, force_n = 60 * slipped, np.array([0.0, 0.0, way_mm])
        shown = replace(frame, force_n=force_n, flags=FrameFlags.CONTACT, trust=trust, slip_level=level)
        moves_mm_s += 0.2 * (grip.step([shown, shown], slipped) - moves_mm_s)
        way_mm += 0.01 * moves_mm_s
        return way_mm

    held_n = [step(Trust.ACT) for _ in range(200)][-1]
    frozen_n = [step(Trust.HOLD) for _ in range(40)][-1]
    at_once_n = [step(Trust.HOLD, k == 0) for k in range(40)][-1]
    assert (frozen_n, at_once_n) == (pytest.approx(held_n, rel=0.02), pytest.approx(1.4 * held_n, rel=0.1))
    step(Trust.ACT, True)
    assert grip.slips == 1 and grip.stiffness == pytest.approx(1.0, rel=0.15)


@pytest.mark.nightly
def test_a_run_goes_on_where_it_was_stopped(tmp_path: Path) -> None:
    kept, case = tmp_path / "grasps.jsonl", replace(CASE, seed=3)

    def run(objects: int) -> Any:
        return runs.run([case], objects, None, 1, kept, lambda text: None)

    first = run(2)
    kept.write_bytes(kept.read_bytes()[:-9])  # stopped while it wrote
    assert run(2) == first and set(first) == {(case, 0), (case, 1)}
    assert json.loads(kept.read_text().splitlines()[-1])["outcome"] == first[case, 1]
    whole = kept.read_bytes()
    assert run(2) == first and kept.read_bytes() == whole  # nothing was left to do
    assert runs.digest(None) != runs.digest(Path(__file__))


def test_more_fingers_on_a_side_share_its_force() -> None:
    two, three = (runs.run_trial(replace(CASE, fingers=n), 0, None) for n in (2, 3))
    assert two == three


@pytest.mark.nightly
def test_six_things_are_told_apart(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["grasp", "--controllers", "true,high", "--json", "--out", str(tmp_path)]
    assert main(command) == 0
    true, high = json.loads(capsys.readouterr().out)["tables"][0]["rows"]
    kept = [json.loads(line) for line in (tmp_path / "grasps.jsonl").read_text().splitlines()]
    crushed = sum(row["outcome"]["crushed"] for row in kept if row["case"]["controller"] == "true")
    assert true[4:8] == [6, 0, *[pytest.approx(100 * crushed / 6, abs=1e-3)] * 2] and crushed <= 1
    assert high[5] == 100  # it never presses
    assert {path.name for path in tmp_path.iterdir()} == {"grasp.md", "grasp.png", "grasp.json", "grasps.jsonl"}
    assert main([*command[:2], "nobody"]) == 2


def test_the_law_in_c_is_the_same() -> None:
    """Round by round on the same frames, to the wire's resolution: 0.1 mN of shear is 0.05 mm/s in a reflex."""
    python, in_c, plant, sense = Grip(), law.load(IN_C)["Grip"](), Plant(ITEM), TrueForce(2)
    for k in range(400):
        plant.step(python.speed_mm_s, 2.0 if k > 200 else 0.0)
        felt = sense.feel(plant)
        assert felt is not None
        felt = ([None, None], k == 256) if k in (150, *range(250, 262)) else felt
        assert in_c.step(*felt) == pytest.approx(python.step(*felt), abs=5e-2)
    assert (in_c.holds, in_c.slips, in_c.settled) == (python.holds, python.slips, python.settled) and python.slips > 0


def test_the_law_in_c_releases_what_it_has_let_go() -> None:
    """A board with a HOLD says CONTACT until RELEASE, however far the hand has opened."""
    library, sent = (law.load(IN_C)[name] for name in ("LIBRARY", "sent"))
    live, finger, releases = LiveFingers({"index": SimFinger(1)}), Finger(), 0.0

    def rounds(count: int, press_n: float) -> float:
        nonlocal releases
        for _ in range(count):
            words = live.read({"index": SimTouch(press_n)})[:, 0]
            row = finger.feed(words[:, slots.ELECTRODE_SLOT], words[:, slots.PDC_SLOT])[0]
            names = DTYPES[messages.FrameMessage.ID].names or ()
            data = sent(messages.FrameMessage, **{name: row[name] for name in names})
            before, releases = releases, library.chip_round(data, len(data))[5]
            if releases > before:
                finger.release()
        return releases

    library.grip_begin(ctypes.c_float(0.8), ctypes.c_float(12.0))
    before = rounds(500, 0.0)
    finger.hold()
    assert rounds(200, 2.0) == before
    library.grip_end()
    assert rounds(20, 1.0) == before
    assert 1 <= rounds(100, 0.0) - before <= 2  # again if it was lost
    rows = finger.feed(live.read({})[:, 0, slots.ELECTRODE_SLOT])
    assert rows["tare_state"][0] == TareState.REST and not rows["flags"][0] & FrameFlags.HELD


def test_a_hand_on_a_board_grasps_and_does_so_again() -> None:
    case = replace(CASE, controller="default")
    first = runs.run_trial(case, 1, None)
    assert first == runs.run_trial(case, 1, None)  # lock-step: to the last digit
    assert not first["dropped"] and first["off_n"] is not None and FrameFlags.HELD & FrameFlags(first["flags"])


@pytest.mark.parametrize("fault", ["still program", "restart", "cable", "open"])
def test_a_fault_in_mid_grasp_is_seen_and_outlived(fault: str) -> None:
    """By the true force of the plant: the board's own frames stop, or are flagged."""
    plant, seen = Plant(ITEM), []
    sense = Board(CASE.seeds, "new", "E17")
    try:
        for k in range(200):
            plant.step(10.0 if plant.normal_n < 2 else 0.0, 0.0)
            if k == 60:
                sense.fault(fault)
            seen.append(sense.feel(plant))
    finally:
        sense.close()
    healthy, hit, after = seen[59], seen[61], seen[199]
    assert healthy is not None and after is not None and healthy[0][0] is not None and after[0][0] is not None
    if fault == "still program":
        assert seen[60:110] == [None] * 50 and seen[110] is not None
    elif fault == "open":
        assert hit is not None and hit[0][0] is not None and hit[0][0].flags & FrameFlags.RAIL
    else:
        assert hit is not None and hit[0] == [None, None]
    if fault == "restart":
        assert after[0][0].flags & FrameFlags.TARE_LIKELY  # the library gave the tare back, and it agrees


@pytest.mark.nightly
@pytest.mark.parametrize("seed", [1, 4, 11])
def test_the_experiment_can_tell(seed: int) -> None:
    controllers = "true,low,high,constant"
    assert main(["grasp", "--controllers", controllers, "--objects", "200", "--seed", str(seed), "--check"]) == 0


@pytest.mark.nightly
@pytest.mark.parametrize("plant", runs.PLANTS)
def test_the_law_holds_things_of_every_plant(plant: str) -> None:
    if plant == "mujoco":
        pytest.importorskip("mujoco", reason="pip install 'biotac-lab[mujoco]'")
    cases = [replace(CASE, plant=plant, seed=4711)]
    lost = [row["dropped"] or row["crushed"] for row in runs.run(cases, 200, None, 2, None, lambda text: None).values()]
    assert len(lost) == 200 and sum(lost) <= 16


@pytest.mark.nightly
@pytest.mark.parametrize("plant", ["numpy", "mujoco"])
def test_boards_grasp_what_their_calibrations_let_them(plant: str, capsys: pytest.CaptureFixture[str]) -> None:
    if plant == "mujoco":
        pytest.importorskip("mujoco", reason="pip install 'biotac-lab[mujoco]'")
    wide = ["--profile", "new,worn", "--at", "E17,E3", "--fault", "all"] if plant == "numpy" else ["--fingers", "3"]
    command = ["grasp", "--objects", "2", "--jobs", "2", "--controllers", "true,own,lin,default", "--json"]
    assert main([*command, "--plant", plant, *wide]) == 0
    rows = json.loads(capsys.readouterr().out)["tables"][0]["rows"]
    assert {row[4] for row in rows} == {2} and len(rows) == (1 + 3 * 4 * 18 if plant == "numpy" else 4)


@pytest.mark.nightly
def test_python_and_c_hold_the_same_things(capsys: pytest.CaptureFixture[str]) -> None:
    pages = []
    for path in (None, IN_C):
        own = ["--law", str(path)] if path else []
        assert main(["grasp", "--controllers", "true,default", "--objects", "20", *own]) == 0
        pages.append(capsys.readouterr().out)
    assert pages[0] == pages[1]


def test_slip_counts_what_a_board_tells(capsys, tmp_path) -> None:
    pac = np.full((3, 600), 0)
    pac[1, 100:300] = np.rint(300 * np.sin(np.arange(200) * 2 * np.pi * 160 / 2200))  # as it slides
    pac[2, 50:300] = np.rint(300 * np.sin(np.arange(250) * 2 * np.pi * 160 / 2200))  # before the tap
    np.savez(tmp_path / "taps.npz", handover_rod_signals=pac)
    assert main(["slip", "--fingers", "1", "--seed", "3", "--taps", str(tmp_path / "taps.npz"), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    simulated, taps = (table["rows"] for table in facts["tables"])
    assert dict(taps) == {"handovers": 3, "with a SLIP, %": 66.6667, "before the tap, %": 33.3333}
    percent = {(case, n_s): row for case, n_s, *row in simulated}
    assert percent["slides at 20 mm/s: told within 50 ms", 0.0] == [100.0] * 3
    assert percent["at rest and in still holds: level 0", 0] == [100.0] * 3
    assert len([case for case, _ in percent if case == "squeezed: SLIP"]) == 9
