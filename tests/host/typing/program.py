"""A user's program with the public names; test_program.py runs mypy and pyright on it."""

import numpy as np
from numpy.typing import NDArray

import biotac


def touched(touch: biotac.Touch) -> None:
    index: int = touch.finger
    print(index, touch.t_us)


def tared(tare: biotac.Tare) -> None:
    reason = biotac.TareReason(tare.reason)
    print(reason.name)


def counted(status: biotac.Status) -> None:
    dropped: int = status.messages_dropped
    print(dropped)


def happened(event: biotac.Event) -> None:
    kind: biotac.EventKind = biotac.EventKind(event.kind)
    print(kind.name, kind is biotac.EventKind.SLIP)


def missed(gap: biotac.Gap) -> None:
    rounds: int | None = gap.frames_missed
    print(gap.reason, gap.fingers, rounds, gap.holds_lapsed, gap.seconds)


def arrived(batch: biotac.Batch) -> None:
    seq: NDArray[np.int64] = batch.seq
    forces = batch.frames["force_n"]
    print(seq, forces)


def main(port: str | None = None) -> float:
    with biotac.open(port, reconnect=True, fingers={"index": 0, "thumb": 4}) as hand:
        unsubscribe = hand.on_batch(arrived)
        hand.on_touch(touched)
        hand.on_tare(tared)
        hand.on_status(counted)
        hand.on_event(happened)
        hand.on_slip(happened)
        hand.on_gap(missed)
        warnings: list[biotac.HandWarning] = hand.warnings
        faults: biotac.Faults = hand.board.clear_faults()
        hand.stream("force", "touch", fingers=["index", 4], rest=False, rate_hz=50)
        hand.tare("index")
        with hand.grasp("index", "thumb"):
            frames = hand.read(0.1, fresh=True)
        names: list[str] = list(hand)
        finger: biotac.FingerView = hand[frames["finger"][0]]
        force_n: NDArray[np.float64] = finger.force_n
        frame: biotac.Frame = finger.frame
        newer: biotac.Frame = finger.next_frame(timeout_s=0.5)
        stale: str = finger.stale
        touched_now: bool = finger.touched
        flags: biotac.FrameFlags = finger.flags
        held = biotac.FrameFlags.HELD in flags
        same: bool = frame == finger.frame
        solve = biotac.per_frame(np.full(19, 2000.0), {biotac.Setting.FORCE_GAIN_Z_NN: 1_000_000})
        result = solve(frame.counts)
        status: biotac.Status = hand.status()
        stats: biotac.LinkStats = hand.stats
        unsubscribe()
    print(warnings, faults.board & biotac.FaultFlags.DROPPED, newer.t_us, stale, touched_now, held)
    print(names, force_n, same, result["force_n"], status.uptime_s, stats.frames_lost)
    return finger.age_s


async def looped(port: str) -> int:
    frames = 0
    async with biotac.aio.open(port) as hand:
        async for batch in hand.batches():
            frames += len(batch.wire)
        status: biotac.Status = await hand.ask(lambda h: h.status())
    return frames + status.slots_late


def kept(port: str, path: str) -> biotac.Recording:
    with biotac.open(port) as hand, hand.record(path) as recorder:
        calibration: biotac.Calibration | None = hand.board.calibration("index")
        if calibration is None and hand.board.calibration_state("index") is biotac.CalibrationState.NONE:
            model = hand.board.setting(biotac.Setting.FORCE_MODEL)
            print(biotac.ForceModel(model), biotac.PocWeights(hand.board.setting(biotac.Setting.POC_WEIGHTS)))
        hand.read(1.0)
    files: biotac.Recorder = recorder
    recording = biotac.Recording(files.path)
    part: biotac.Selection = recording.select(fingers="index", fields=["force_n"], stop_s=1.0).resample(10)
    labels: list[biotac.Label] = recording.labels
    print(part.rows["force_n"].max(), [label.line() for label in labels])
    print(biotac.load(files.path).dtype == biotac.FRAME_DTYPE, biotac.PAC_DTYPE, biotac.IDLE_DTYPE, biotac.__version__)
    print(biotac.export.FORMATS, biotac.clock.LAST_SAMPLE_US, biotac.calibrate.__name__)
    return recording


def computed(counts: NDArray[np.uint16], tare: NDArray[np.float64]) -> NDArray[np.float64]:
    results = biotac.compute(counts, tare)
    print(results.dtype == biotac.RESULT_DTYPE, biotac.MAPPED_RESULT_DTYPE, biotac.FINGER_DTYPE)
    finger = biotac.Finger(quantities=biotac.QuantityFlags.FORCE)
    print(finger.tare_counts, biotac.TareState.REST, biotac.Trust.ACT)
    force_n: NDArray[np.float64] = results["force_n"]
    return force_n


def careful(port: str) -> str:
    """Every error, from the special to the general."""
    try:
        main(port)
    except (biotac.PortBusyError, biotac.PortError, biotac.NotAGatewayError, biotac.WireVersionError) as error:
        return str(error)
    except (biotac.ScenarioError, biotac.RecordingError, biotac.InputError) as error:
        return str(error)
    except biotac.CommandRefusedError as error:
        return f"{error.error}"
    except (biotac.DeviceLostError, biotac.StreamTakenError, biotac.CallbackError, biotac.FlashError) as error:
        return str(error)
    except biotac.BiotacError as error:
        return f"{error.exit_code}"
    kinds: list[type[UserWarning]] = [biotac.ReadWarning, biotac.RecordingWarning]
    return str(kinds)


def closed(hand: biotac.Hand) -> bool:
    hand.close()
    return hand.connected
