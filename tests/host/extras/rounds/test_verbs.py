"""The command line on other drivers' messages: how to read them, which fault they have, where it was stopped."""

import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from robot_messages import Robot
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import biotac
from biotac.cli.main import main
from biotac.errors import InputError
from biotac.extras.rounds.ros import decoder
from biotac.sim.loading import load_source

ROWS = load_source("press.toml", fingers=1, seconds=4.0).samples.astype(int)


@pytest.fixture
def port(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    return Robot(pac=True).write(Path("x.bag"), ROWS)


def said(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """Both streams of a verb, in one line."""
    main([*words])
    return " ".join("".join(capsys.readouterr()).split())


@pytest.mark.parametrize(
    "words", ["check x.bag", "info x.bag", "export x.bag y.csv", "export x.bag y.mcap", "file recover x.bag y.mcap"]
)
def test_a_bag_where_a_recording_is_wanted_says_how_it_becomes_one(port: str, capsys: Any, words: str) -> None:
    assert "`biotac record 'bag:x.bag' x.mcap` makes a recording of it" in said(capsys, *words.split())
    Path("x.csv").write_text("a,b\n")
    table = "`biotac record 'csv:x.csv?columns=COLUMNS.toml' x.mcap`"
    assert table in said(capsys, *words.replace("x.bag", "x.csv").split())


def test_a_packed_btd_is_no_port_but_can_be_played(port: str, capsys: Any) -> None:
    assert "x.btd.gz is a file, not a port; play it with sim:x.btd.gz" in said(capsys, "info", "x.btd.gz")


def test_the_doctor_has_no_slots_of_messages(port: str, capsys: Any) -> None:
    text = said(capsys, "doctor", port)
    assert "measured: 300 frames, no rates" in text and "healthy" in text


def test_a_stopped_recording_of_a_file_says_where(port: str, capsys: Any, interrupt_at: Any) -> None:
    interrupt_at(lambda k, text: not text.startswith("0.0 s"))
    text = said(capsys, "record", port, "x.mcap")
    (stopped_s,) = re.findall(
        rf"{re.escape(port)} was stopped at (\d\.\d) s of it: the recording has not the rest", text
    )
    assert 0.0 < float(stopped_s) < 4.0


def test_results_beside_results_are_refused(port: str, capsys: Any) -> None:
    for out, beside in (("a.bag", "x.bag"), ("b.bag", "a.bag")):
        said(capsys, "record", port, "x.mcap", "--force")
        text = said(capsys, "export", "x.mcap", out, "--beside", beside)
    assert "a.bag has results already (/biotac/finger0/" in text and not Path("b.bag").exists()


def test_a_bag_of_any_case_is_read_and_a_damaged_one_has_its_cure(port: str) -> None:
    shutil.copy("x.bag", "y.BAG")
    assert len(biotac.open("bag:y.BAG").read(100.0)) == 400
    Path("z.bag.active").write_bytes(Path("x.bag").read_bytes()[:13])
    with pytest.raises(InputError, match=r"\(.+\); a recorder that was killed leaves it so: `rosbag reindex` mends"):
        biotac.open("bag:z.bag.active")
    Path("folder").mkdir()
    with pytest.raises(InputError, match=r"\(.+\); .* `mcap recover`, then `ros2 bag reindex` mends"):
        biotac.open("bag:folder")


def test_a_variant_without_temperature_pac_and_header_is_read() -> None:
    store, kind = get_typestore(Stores.ROS1_NOETIC), "own/msg/BiotacAll"
    store.register(get_types_from_msg("int16 pdc\nint16[] electrodes\n", "own/msg/Biotac"))
    store.register(get_types_from_msg("own/Biotac[] tactiles\n", kind))
    own = store.types["own/msg/Biotac"](2000, np.arange(3000, 3019, dtype=np.int16))
    raw = bytes(store.serialize_ros1(store.types[kind]([own]), kind))
    message = decoder(kind, store.generate_msgdef(kind)[0], ros1=True)(raw, 7)
    (counts, *others) = message.fingers
    assert (message.stamp_ns, message.logged_ns, others) == (0, 7, [None] * 4) and counts is not None
    assert counts.pdc == 2000 and counts.tac is None and not len(counts.pac) and counts.electrodes[18] == 3018
