"""bag: ports: the board's own session on rounds that other drivers published, against the simulated board."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from robot_messages import HAND, START_NS, Robot

import biotac
from biotac.errors import InputError, PortError
from biotac.sim.loading import load_source
from biotac.wire import messages_gen as wire
from biotac.wire import slots
from biotac.wire.batches import Batch

SECONDS = 8.0


def samples(fingers: int = 2, scenario: str = "grasp.toml", seconds: float = SECONDS) -> np.ndarray:
    return load_source(scenario, fingers=fingers, seconds=seconds).samples


def played(port: str) -> tuple[Batch, list[str], wire.Hello]:
    with biotac.open(port) as hand:
        hand.stream("results", "events")
        return hand.read_batch(1000.0), list(hand.link.notes), hand.info


def events(batch: Batch) -> list[tuple[Any, ...]]:
    found = [m for m in batch.messages if isinstance(m, wire.Event)]
    first = int(batch.frames["t_us"].min())
    return sorted((m.finger, m.seq, m.kind, m.slot, m.t_us - first, m.onset_us - first, m.peak_count) for m in found)


def kinds(batch: Batch) -> set[str]:
    return {wire.EventKind(kind).name for _, _, kind, *_ in events(batch)}


@pytest.fixture(scope="module")
def simulated() -> Batch:
    with biotac.open(f"sim:grasp.toml?fingers=2&seconds={SECONDS}") as hand:
        hand.stream("results", "events")
        return hand.read_batch(1000.0)


@pytest.mark.parametrize("ros1", [pytest.param(True, marks=pytest.mark.nightly), False])
def test_a_bag_with_every_slot_is_bit_for_bit_the_simulated_board(tmp_path: Path, simulated: Batch, ros1: bool) -> None:
    batch, notes, hello = played(Robot(HAND, ros1=ros1).write(tmp_path / ("a.bag" if ros1 else "a"), samples()))
    assert notes == [] and hello.board == wire.BoardKind.MESSAGES and hello.slot_hz == 4400
    ours, theirs = (np.sort(b.frames, order=["finger", "seq"]) for b in (batch, simulated))
    for name in ("seq", "counts", "pdc", "tac", "tdc", "tare", "pdc_tare", "poc_mm", "tare_state"):
        np.testing.assert_array_equal(ours[name], theirs[name], err_msg=name)
    pac = [np.sort(b.pac, order=["finger", "seq"])["pac"] for b in (batch, simulated)]
    np.testing.assert_array_equal(*pac)
    assert events(batch) == events(simulated) and {"JOLT", "SLIP", "TOUCH"} <= kinds(batch)


def test_a_hand_that_gives_no_times_of_its_slots_is_read(tmp_path: Path, simulated: Batch) -> None:
    batch, notes, hello = played(Robot(HAND, timed=False).write(tmp_path / "a.bag", samples()))
    assert notes == [] and hello.slot_hz == 0
    np.testing.assert_array_equal(np.sort(batch.frames["counts"], axis=0), np.sort(simulated.frames["counts"], axis=0))


@pytest.mark.parametrize("ros1", [True, pytest.param(False, marks=pytest.mark.nightly)])
def test_shadows_message_has_its_fingers_and_slip_only_with_all_pac(tmp_path: Path, ros1: bool) -> None:
    rows = [[row[0], None, None, None, row[1]] for row in samples()]
    old, why, hello = played(Robot(ros1=ros1).write(tmp_path / ("old.bag" if ros1 else "old"), rows))
    new, quiet, _ = played(Robot(ros1=ros1, pac=True).write(tmp_path / ("pac.bag" if ros1 else "pac"), rows))
    assert set(old.frames["finger"]) == set(new.frames["finger"]) == {0, 4} and hello.slot_hz == 0
    assert {"SLIP", "JOLT"} <= kinds(new) and kinds(old) == {"TOUCH", "TRUST"}
    assert quiet == [] and [text for text in why if "2 of 22 samples" in text and "no SLIP" in text] == why
    assert {m.slot for m in new.messages if isinstance(m, wire.Event)} == {255}  # the time within a round is unknown


@pytest.mark.nightly
def test_pac_at_2000_hz_is_resampled_and_a_fast_topic_is_thinned(tmp_path: Path) -> None:
    rows = samples(1)
    twenty = np.stack([np.interp(np.arange(20) * 1.1, np.arange(22), row[0, slots.PAC_SLOT]) for row in rows])
    robot = Robot(pac=True)
    message = robot.message
    robot.message = lambda ns, row, serials=(): _with_pac(message(ns, row), twenty[(ns - START_NS) // 10_000_000])  # type: ignore[method-assign]
    batch, notes, _ = played(robot.write(tmp_path / "a.bag", rows))
    assert notes == ["finger 0: PAC at 2000 Hz is resampled to 2200 Hz"] and "SLIP" in kinds(batch)
    # A publisher at 1 kHz sends two samples each: together they are all.
    fast = Robot()
    each = fast.message
    fast.message = lambda ns, row, serials=(): _with_two(each(ns, row), twenty, ns)  # type: ignore[method-assign]
    ns = START_NS + 1_000_000 * np.arange(10 * len(rows))
    batch, notes, _ = played(fast.write(tmp_path / "b.bag", np.repeat(rows, 10, axis=0), stamps_ns=ns))
    assert len(batch.frames) == pytest.approx(len(rows), abs=2) and "SLIP" in kinds(batch)
    assert notes == [
        "1000 messages a second: one in 10 makes a round, with all PAC",
        "finger 0: PAC at 2000 Hz is resampled to 2200 Hz",
    ]


def _with_pac(message: Any, pac: np.ndarray) -> Any:
    message.tactiles[0].pac = np.rint(pac).astype(np.int16)
    return message


def _with_two(message: Any, pac: np.ndarray, ns: int) -> Any:
    round_, part = divmod((ns - START_NS) // 1_000_000, 10)
    message.tactiles[0].pac0, message.tactiles[0].pac1 = (int(x) for x in np.rint(pac[round_, 2 * part : 2 * part + 2]))
    return message


def test_own_stamps_are_kept_and_gaps_told(tmp_path: Path) -> None:
    rows = samples(1)[:400]
    steps = np.random.default_rng(0).integers(9_000_000, 18_000_000, len(rows))
    steps[200] = 300_000_000
    ns = START_NS + np.cumsum(steps)
    batch, notes, _ = played(Robot().write(tmp_path / "a.bag", rows, stamps_ns=ns))
    np.testing.assert_array_equal(batch.frames["t_us"], (ns - ns[0]) // 1000)
    assert any("1 gap(s) of more than 0.09 s, the longest 0.30 s" in text for text in notes)
    rate = 1e9 / np.delete(steps[1:], 199).mean()
    assert any(f"{rate:.0f} rounds a second" in text for text in notes)
    (gap,) = [m for m in batch.messages if isinstance(m, biotac.Gap)]
    assert gap.seconds == pytest.approx(0.3) and gap.reason == "finger"


def test_each_pause_is_a_gap_and_a_long_one_loses_no_number(tmp_path: Path) -> None:
    ns = START_NS + 10_000_000 * np.arange(400)
    for at, pause_s in ((3, 0.3), (300, 0.5), (320, 0.4), (340, 1000)):
        ns[at:] += round(pause_s * 1e9)
    with biotac.open(Robot(HAND).write(tmp_path / "a.bag", samples(1)[:400], stamps_ns=ns)) as hand:
        gaps = [m for m in hand.read_batch(2000.0).messages if isinstance(m, biotac.Gap)]
        assert hand.stats.frames_lost == 0 and hand.stats.gaps == 4
    assert [(gap.fingers, gap.seconds) for gap in gaps] == [(1, 0.31), (1, 0.51), (1, 0.41), (1, 1000.01)]


@pytest.mark.parametrize(("step_ms", "words"), [(25, "40 a second, expected at least 50"), (1000, "1 a second")])
def test_a_slow_topic_is_refused(tmp_path: Path, step_ms: int, words: str) -> None:
    ns = START_NS + step_ms * 1_000_000 * np.arange(100)
    with pytest.raises(PortError, match=words):
        biotac.open(Robot().write(tmp_path / "a.bag", samples(1)[:100], stamps_ns=ns))


def test_two_hands_in_a_bag_have_to_be_named(tmp_path: Path) -> None:
    port = Robot().write(tmp_path / "a.bag", samples(1)[:100], topics=("/rh/tactile", "/lh/tactile"))
    with pytest.raises(InputError, match=r"it has /lh/tactile .*, /rh/tactile .*: \?topic="):
        biotac.open(port)
    batch, _, _ = played(f"{port}?topic=/lh/tactile")
    assert len(batch.frames) == 100
    with pytest.raises(InputError, match="topic /x"):
        biotac.open(f"{port}?topic=/x")


def test_a_calibration_hold_and_tare_work_as_on_any_board(tmp_path: Path) -> None:
    with biotac.open(Robot(HAND).write(tmp_path / "a.bag", samples(1))) as hand:
        hand.board.set_calibration(0, biotac.Calibration(serial="BT2P000000000000"))
        hand.stream("results")
        assert len(hand.read(0.5)) and hand.board.calibration_state(0) == wire.CalibrationState.IN_FORCE
        hand.hold(0)
        hand.tare(0)
        rows = hand.read(3.0)
        hand.release(0)
        assert (rows["flags"] & wire.FrameFlags.HELD).any() and (rows["flags"] & wire.FrameFlags.TARE_CHANGED).any()


@pytest.mark.parametrize("port", ["bag:", "bag:?topic=/rh/tactile", "csv:", "replay:"])
def test_a_port_without_a_file_asks_for_one(port: str) -> None:
    with pytest.raises(PortError, match="names no file; expected"):
        biotac.open(port)


@pytest.mark.parametrize("name", ["a.bag", "folder"])
def test_what_is_no_bag_is_refused_in_words(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="does not exist"):
        biotac.open(f"bag:{tmp_path / name}")
    (tmp_path / name).write_bytes(b"#ROSBAG V2.0\n" + bytes(100))
    with pytest.raises(InputError, match="cannot be read as a ROS bag"):
        biotac.open(f"bag:{tmp_path / name}")


@pytest.mark.nightly
def test_the_real_trials_force_is_along_the_plates_normal(shared_data: Path) -> None:
    batch, notes, _ = played(f"bag:{shared_data / 'owners/rf15330_biotacall.bag'}")
    real = np.load(shared_data / "robotic_finger/trial_15330.npz")
    z, pdc = real["z_dir"], real["PDC"].astype(int)
    normal = -np.c_[-z[:, 0], z[:, 1], -z[:, 2]]
    rows = batch.frames
    assert len(rows) == len(pdc) == 5185 and any("the longest 0.26 s" in text for text in notes)
    used = (pdc > np.median(pdc[:200]) + 100) & (rows["flags"] & wire.FrameFlags.CONTACT != 0)
    cosine = (rows["force_n"] * normal)[used].sum(axis=1) / np.linalg.norm(rows["force_n"][used], axis=1)
    degrees = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    print(f"{used.sum()} frames: {np.percentile(degrees, [50, 90]).round(1)} degrees (median, 90 %)")
    assert used.sum() > 300 and np.isfinite(degrees).all() and np.median(degrees) <= 10.5
    np.testing.assert_allclose(rows["t_us"], (real["t"] - real["t"][0]).astype(float) * 1e6, atol=1)
    assert [m.seconds for m in batch.messages if isinstance(m, biotac.Gap)] == [pytest.approx(0.26, abs=0.02)]
