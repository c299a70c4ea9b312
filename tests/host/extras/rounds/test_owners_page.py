"""host/docs/guides/owners.md: the commands work, and the page shows a bag at any time in it."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from live_board import until
from robot_messages import START_NS, Robot
from rosbags.highlevel import AnyReader
from served_page import health

import biotac
from biotac.cli.main import main
from biotac.sim.loading import load_source
from biotac.view.serving import Viewing
from biotac.wire import slots

PAGE = (Path(__file__).parents[4] / "host/docs/guides/owners.md").read_text(encoding="utf-8")
COMMANDS = [shlex.split(c) for c in re.findall(r"^    biotac (\S.*?)(?:\s+#.*)?$", PAGE, flags=re.M)]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    rows = load_source("press.toml", fingers=1, seconds=4.0).samples.astype(int)
    Robot(pac=True).write(tmp_path / "grasp.bag", rows)
    Robot().write(tmp_path / "both.bag", rows, topics=("/rh/tactile", "/lh/tactile"))
    toml = re.search(r"\n\n((?:    .*\n)*    pdc = .*\n)", PAGE)
    assert toml is not None
    (tmp_path / "columns.toml").write_text(re.sub("^    ", "", toml[1], flags=re.M))
    head = ["t", *(f"E{k}" for k in range(1, 20)), "PDC"]
    lines = [[k / 100, *row[0, slots.ELECTRODE_SLOT], row[0, slots.PDC_SLOT]] for k, row in enumerate(rows)]
    (tmp_path / "press.csv").write_text("\n".join(",".join(map(str, line)) for line in [head, *lines]))
    return tmp_path


def test_the_pages_commands_run(folder: Path) -> None:
    ran = [words for words in COMMANDS if words[0] != "view" and "foxglove" not in words[1]]
    assert [words[0] for words in ran] == ["record", "doctor", "check", "export", "doctor", "record"] and len(
        COMMANDS
    ) == 9
    for words in ran:
        assert main(words) == (words[1].startswith("bag:both")), words  # the doctor finds that PAC is missing
    for words in (["record", "bag:grasp.bag", "x.mcap"], ["record", "bag:no.bag", "y.mcap"]):
        assert main([*words]) == (0 if "grasp" in words[1] else 2)
    with AnyReader([folder / "results.bag"]) as bag:
        by_topic = {c.topic: c for c in bag.connections}
        assert by_topic["/rh/tactile"].msgcount == by_topic["/biotac/finger0/wrench"].msgcount == 400
        wrench = by_topic["/biotac/finger0/wrench"]
        found = [(ns, bag.deserialize(raw, wrench.msgtype)) for _, ns, raw in bag.messages(connections=[wrench])]
    assert [ns for ns, _ in found] == [START_NS + k * 10_000_000 for k in range(400)]
    assert {message.header.frame_id for _, message in found} == {"rh_ffdistal"}
    force_n = np.array([[getattr(m.wrench.force, axis) for axis in "xyz"] for _, m in found])
    recording = biotac.Recording("grasp.mcap")
    np.testing.assert_array_equal(force_n, recording.frames["force_n"])
    np.testing.assert_array_equal(recording.stamp_ns(recording.frames["t_us"]), [ns for ns, _ in found])
    assert [label.text for label in biotac.Recording("press.mcap").labels] == [
        "finger 0: 0 of 22 samples of PAC a round: no vibration, no JOLT and no SLIP"
    ]


def test_the_page_goes_to_any_time_of_a_bag(folder: Path) -> None:
    viewing = Viewing("bag:grasp.bag", port=0, folder=folder)
    try:
        viewing.reader.ask("seek", None, 2.5)
        until(lambda: (health(viewing.state)["position_s"] or 0.0) >= 2.5)
    finally:
        viewing.close()
