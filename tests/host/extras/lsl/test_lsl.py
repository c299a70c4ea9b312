"""LSL streams, received by pylsl itself over this computer's network."""

import re
import sys
import time
import types
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pylsl
import pytest

import biotac
from biotac.cli.main import main
from biotac.clock import DeviceClock, pac_t_us
from biotac.extras.lsl.outlet import Outlet, samples
from biotac.hand.silence import Silence

PATIENCE_S = 300.0


@pytest.fixture
def inlet() -> Iterator[Callable[[Any], Any]]:
    """Makes an inlet of an outlet's stream, found as any program would find it."""
    made: list[Any] = []

    def make(info: Any) -> Any:
        found = pylsl.resolve_byprop("source_id", info.source_id(), timeout=PATIENCE_S)
        assert len(found) == 1
        made.append(pylsl.StreamInlet(found[0]))
        made[-1].open_stream(timeout=PATIENCE_S)
        return made[-1]

    yield make
    for one in made:
        one.close_stream()


def pull(stream: Any, n: int) -> tuple[np.ndarray, np.ndarray]:
    """The first n samples, and their stamps."""
    pulled = [stream.pull_sample(timeout=PATIENCE_S) for _ in range(n)]
    return np.array([p[0] for p in pulled]), np.array([p[1] for p in pulled])


def test_every_sample_arrives_at_its_device_time_on_lsls_clock(inlet, monkeypatch) -> None:
    # Both clocks stand still, so that nothing depends on how long passes between looks at them.
    monkeypatch.setattr(pylsl, "local_clock", lambda: 1000.0)
    monkeypatch.setattr(time, "monotonic", lambda: 70.0)
    with biotac.open("sim:shear.toml?fingers=2&seconds=3") as hand, Outlet(hand) as outlet:
        names = [info.name() for info in outlet.infos]
        assert names[:4] == [f"{outlet.name} finger{k}{kind}" for k in (0, 1) for kind in ("", " PAC")]
        assert names[4:] == [f"{outlet.name} finger{k} events" for k in (0, 1)]
        frames_in, pac_in = inlet(outlet.infos[2]), inlet(outlet.infos[3])
        batch = hand.read_batch(10.0)
        frames = batch.frames[batch.frames["finger"] == 1]
        pac = batch.pac[batch.pac["finger"] == 1]
        # Device second k was second 50 + k of the computer's clock, which LSL's is ahead of.
        clock = hand.clock = DeviceClock()
        for k in range(20):
            clock.round_trip(50.0 + k, 1_000_000 * k, 50.0 + k)
        apart_s = 1000.0 - 70.0
        outlet.push(batch)
        assert (outlet.pushed, outlet.by_arrival) == (600, 0)
        values, stamps_s = pull(frames_in, 300)
        pac_values, pac_stamps_s = pull(pac_in, 22 * 300)
    np.testing.assert_array_equal(values, samples(frames))
    assert np.isnan(values[0, :9]).all()  # not tared yet, and no zero
    np.testing.assert_array_equal(pac_values.ravel(), pac["pac"].ravel())
    np.testing.assert_allclose(stamps_s, 50.0 + frames["t_us"] / 1e6 + apart_s, rtol=0, atol=1e-6)
    np.testing.assert_allclose(np.diff(stamps_s), 0.01, rtol=0, atol=1e-6)
    np.testing.assert_allclose(pac_stamps_s, 50.0 + pac_t_us(pac["t_us"]).ravel() / 1e6 + apart_s, rtol=0, atol=1e-6)


def test_the_description_names_channels_units_and_rate(inlet) -> None:
    with biotac.open("sim:press.toml?seconds=1") as hand, Outlet(hand) as outlet:
        info, pac = (inlet(i).info(timeout=PATIENCE_S) for i in outlet.infos[:2])
        batch = hand.read_batch(10.0)
    listed, channel = [], info.desc().child("channels").child("channel")
    while channel.e and channel.name():
        listed.append((channel.child_value("label"), channel.child_value("unit")))
        channel = channel.next_sibling("channel")
    assert len(listed) == info.channel_count() == samples(batch.frames).shape[1]
    assert listed[:9] == [
        *((f"force_{axis}_n", "N") for axis in "xyz"),
        *((f"torque_{axis}_nmm", "N*mm") for axis in "xyz"),
        *((f"poc_{axis}_mm", "mm") for axis in "xyz"),
    ]
    units = dict(listed)
    assert units["counts_E19"] == units["pdc"] == "count"
    assert info.nominal_srate() == 100.0
    assert pac.nominal_srate() == 2200.0
    assert info.type() == "Tactile"
    assert "tip" in info.desc().child_value("axes")
    assert info.desc().child_value("finger") == "0"


def test_a_finger_has_streams_when_it_comes_and_is_nan_once_when_it_goes(inlet) -> None:
    with biotac.open("sim:press.toml?fingers=2&seconds=3") as hand:
        both, alone = hand.read_batch(2.5), hand.read_batch(0.2)
    rows = alone.wire["finger"] == 0
    alone = replace(alone, wire=alone.wire[rows], seq=alone.seq[rows], t_us=alone.t_us[rows])
    silence = Silence()
    (row,) = [*silence.rows(both), *silence.rows(alone)]
    assert all(np.isnan(row[name]).all() for name in row.dtype.names if row.dtype[name].base.kind == "f")
    with biotac.open("sim:press.toml?seconds=0.5") as hand, Outlet(hand) as outlet:
        outlet.push(both)
        late = outlet.infos[3]
        assert late.name().endswith(" finger1")
        stream = inlet(late)
        outlet.push(both)
        outlet.push(alone)
        outlet.push(alone)
        values, stamps_s = pull(stream, 251)
        assert stream.pull_sample(timeout=0.0)[0] is None
    assert not np.isnan(values[249]).any() and np.isnan(values[250, :13]).all()
    assert (values[250, 14], values[250, 15]) == (biotac.Trust.NONE, 65535) and (np.diff(stamps_s) > 0).all()


def test_columns_are_the_rows() -> None:
    row = np.zeros(1, biotac.FRAME_DTYPE)
    row["force_n"], row["torque_nmm"], row["poc_mm"] = (1, 2, 3), (4, 5, 6), (7, 8, 9)
    row["normal_n"], row["normal_half_n"], row["shear_n"], row["shear_half_n"] = 10, 11, 12, 13
    row["flags"], row["trust"], row["counts"] = 14, 15, np.arange(16, 35)
    row["pdc"], row["tac"], row["tdc"] = 35, 36, 37
    np.testing.assert_array_equal(samples(row), [np.arange(1, 38)])


def test_events_are_markers_by_name(inlet) -> None:
    with biotac.open("sim:press.toml?seconds=3") as hand, Outlet(hand) as outlet:
        hand.stream("events", "raw")
        stream = inlet(outlet.infos[2])
        batch = hand.read_batch(3.0)
        outlet.push(batch)
        event_names = [biotac.EventKind(m.kind).name for m in batch.messages if isinstance(m, biotac.Event)]
        assert "TOUCH" in event_names
        assert [stream.pull_sample(timeout=PATIENCE_S)[0] for _ in event_names] == [[name] for name in event_names]


def test_a_simulated_boards_frames_are_stamped_by_arrival_and_counted(inlet) -> None:
    with biotac.open("sim:press.toml?seconds=0.5") as hand, Outlet(hand) as outlet:
        stream = inlet(outlet.infos[0])
        hand.clock = DeviceClock()
        batch = hand.read_batch(1.0)
        hand.clock = DeviceClock()
        before_s = pylsl.local_clock()
        outlet.push(batch)
        after_s = pylsl.local_clock()
        _, stamps_s = pull(stream, 50)
    assert outlet.by_arrival == 50 * 23
    assert before_s <= stamps_s[-1] <= after_s
    np.testing.assert_allclose(np.diff(stamps_s), 0.01, rtol=0, atol=1e-6)


def test_the_verb_ends_with_its_source_and_says_how_it_stamped(capsys) -> None:
    assert main(["share", "sim:press.toml?seconds=0.3&pace=fast", "--lsl", "--json"]) == 0
    output = capsys.readouterr()
    assert re.search(r'"name": "BioTac posix-sim-[0-9a-f]{8} finger0", "rate_hz": 100.0', output.out)
    assert "stamped by arrival" in output.err


def test_the_verb_tells_rates(capsys) -> None:
    assert main(["share", "sim:press.toml?seconds=0.3&pace=fast", "--lsl", "--seconds", "0.1"]) == 0
    output = capsys.readouterr()
    first, *others = (re.sub("posix-sim-[0-9a-f]{8}", "SERIAL", line) for line in output.out.splitlines())
    assert first == "BioTac SERIAL finger0, 100 samples per second"
    assert "BioTac SERIAL finger0 events, irregular" in others
    assert "Ctrl-C" not in output.err  # it ends by itself


def test_without_pylsl_the_extra_is_named(capsys, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "pylsl", None)
    assert main(["share", "--lsl", "sim:press.toml"]) == biotac.InputError.exit_code
    assert "pip install 'biotac-gateway[lsl]'" in capsys.readouterr().err


def test_without_liblsl_its_own_cure_is_named(capsys, monkeypatch) -> None:
    class Broken:
        """Finds pylsl, and fails as pylsl does without the library."""

        def find_spec(self, name: str, path: object, target: object = None) -> types.ModuleType | None:
            if name == "pylsl":
                raise RuntimeError("LSL binary library file was not found.\nPlease make sure ...")
            return None

    monkeypatch.delitem(sys.modules, "pylsl")
    monkeypatch.setattr(sys, "meta_path", [Broken(), *sys.meta_path])
    assert main(["share", "--lsl", "sim:press.toml"]) == 2
    output = capsys.readouterr().err
    assert "finds no liblsl" in output and "pip install --upgrade pylsl" in output
    assert "not installed" not in output
