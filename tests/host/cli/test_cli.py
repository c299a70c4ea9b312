"""Every verb, and every way to fail: one line on stderr, the fixed exit code, the cure."""

import argparse
import contextlib
import importlib
import json
import os
import subprocess
import sys
import termios
import webbrowser
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import pytest

import biotac
import biotac.kernels.compiled
from biotac.cli.main import VERBS, main, parser
from biotac.wire import messages_gen as wire
from biotac.wire.identity import setting_text


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "biotac", *arguments], capture_output=True, text=True, check=False)


def fails(capsys, code: int, *arguments: str) -> str:
    """Run in this process; the verb must fail with this code and one line, which is returned."""
    assert main(arguments) == code
    error = capsys.readouterr().err
    assert error.startswith("biotac: ")
    assert error.count("\n") == 1
    return error


def test_help_fits_a_screen_and_every_verb_has_an_example(capsys) -> None:
    assert parser().format_help().count("\n") <= 40
    assert len(VERBS) <= 18
    for name, (module, text) in VERBS.items():
        example = importlib.import_module(f"biotac.cli.{module}").EXAMPLE
        with pytest.raises(SystemExit):
            main([name, "--help"])
        output = capsys.readouterr().out
        assert text[:40] in output and output.rstrip().endswith(f"example: {example}")


def test_no_help_text_is_a_request_of_troff() -> None:
    # The man page is made of the help text, and man drops a line that begins with a dot.
    def texts(one: argparse.ArgumentParser) -> Iterator[str]:
        for action in one._actions:
            yield action.help or ""
            if isinstance(action, argparse._SubParsersAction):
                for below in action.choices.values():
                    yield from texts(below)

    assert [text for text in texts(parser()) if text.startswith((".", "'"))] == []


def test_version_names_release_wire_and_schema(capsys) -> None:
    with pytest.raises(SystemExit) as left:
        main(["--version"])
    assert left.value.code == 0
    versions = f"{biotac.__version__}, wire {wire.WIRE_MAJOR}.{wire.WIRE_MINOR}, schema {wire.SCHEMA_HASH:08x}"
    assert capsys.readouterr().out == f"biotac-gateway {versions}\n"


@pytest.mark.skipif(not Path("/proc/self/fdinfo").is_dir(), reason="only Linux tells whose a pty is")
def test_list_shows_simulated_boards_that_run(capsys) -> None:
    command = [str(Path(sys.executable).with_name("biotac")), "sim", "press.toml"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as board:
        assert board.stdout is not None
        port = board.stdout.readline().split()[0]
        assert main(["list", "--json"]) == 0
        board.terminate()
    assert json.loads(capsys.readouterr().out)["simulated"][port] == "biotac sim press.toml"


def test_list_leaves_out_a_simulated_board_that_a_program_uses_itself(capsys) -> None:
    with biotac.open("sim:press.toml?seconds=1"):
        assert main(["list", "--json"]) == 0
    assert not any("pytest" in command for command in json.loads(capsys.readouterr().out)["simulated"].values())


def test_info_tells_board_sensors_and_settings(capsys) -> None:
    assert main(["info", "sim:press.toml?fingers=3", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["board"], facts["fingers"]) == ("simulator", 5)
    assert [s["finger"] for s in facts["sensors"]] == [0, 1, 2]
    assert all(s["serial"].startswith("BT") for s in facts["sensors"])
    assert facts["settings"]["contact_energy_count2"] == 1000
    assert facts["schema_matches"] is True


def test_settings_with_names_are_shown_by_name(capsys) -> None:
    assert main(["info", "sim:press.toml?fingers=1"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert {"force_model = POPULATION (1)", "poc_weights = COMPRESS_N1 (1)", "status_period_ms = 1000 ms"} < set(lines)
    assert setting_text(wire.Setting.FORCE_MODEL, 9) == "force_model = 9"  # of a newer board


def test_stream_prints_one_json_object_a_frame(capsys) -> None:
    assert main(["stream", "sim:press.toml?pace=fast", "--seconds", "0.2", "--rate", "0", "--json"]) == 0
    rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [row["seq"] for row in rows] == list(range(20))
    assert rows[0]["force_n"] == [None] * 3
    assert all(len(row["counts"]) == 19 for row in rows)


def test_stream_of_touched_fingers_is_silent_at_rest(capsys) -> None:
    assert main(["stream", "sim:press.toml?pace=fast", "--seconds", "4", "--rate", "0", "--json", "--touched"]) == 0
    flags = [json.loads(line)["flags"] for line in capsys.readouterr().out.splitlines()]
    touched = sum(f & biotac.FrameFlags.CONTACT != 0 for f in flags)
    assert touched > 100
    # The first, the tares, the rounds before a contact is sure, and moved electrodes: not a second's worth.
    assert len(flags) - touched < 20


def test_stream_prints_events_between_the_frames(capsys) -> None:
    assert main(["stream", "sim:press.toml?pace=fast", "--seconds", "4", "--json", "--events"]) == 0
    rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    kinds = [row["event"] for row in rows if "event" in row]
    assert "touch" in kinds and any("force_n" in row for row in rows)
    levels = [row["trust"] for row in rows if row.get("event") == "trust"]
    assert levels and {row["trust"] for row in rows if row.get("event") == "jolt"} == {None}
    assert main(["stream", "sim:press.toml?pace=fast", "--seconds", "4", "--events"]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if "  trust " in line]
    seen, expected = [line.split("trust ")[1] for line in lines], [biotac.Trust(level).name for level in levels]
    both = min(len(seen), len(expected))  # either run may read a round more than the other
    assert both and seen[:both] == expected[:both]


def test_stream_prints_a_recordings_events_only_when_asked(tmp_path, capsys) -> None:
    with biotac.open("sim:press.toml?seconds=4") as hand, hand.record(tmp_path / "a.mcap"):
        hand.stream("results", "events")
        hand.read(seconds=3.5)
    for asked in (["--events"], []):
        assert main(["stream", f"replay:{tmp_path}/a.mcap?pace=fast", "--json", *asked]) == 0
        rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
        assert any("event" in row for row in rows) == bool(asked) and any("force_n" in row for row in rows)


def test_stream_thins_out_for_people(capsys) -> None:
    assert main(["stream", "sim:press.toml?pace=fast", "--seconds", "1", "--rate", "5"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 5


def test_record_then_check(capsys, tmp_path: Path) -> None:
    out = tmp_path / "a.mcap"
    # all that there is: the last row's own 10 ms count
    assert main(["record", "sim:press.toml?fingers=2&seconds=2", str(out), "--seconds", "2", "--json", "--fact",
                 "subject=S03", "--fact", "trial=7"]) == 0  # fmt: skip
    assert json.loads(capsys.readouterr().out)["frames_lost"] == 0
    assert set(biotac.Recording(out).to_pandas()["label"]) == {"subject=S03 trial=7"}
    assert main(["check", str(out), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["good"] is True
    assert facts["crosscheck"]["violations"] == 0
    assert facts["frames"] >= 400
    assert wire.EventKind.TOUCH in {m.kind for m in biotac.Recording(out).messages if isinstance(m, wire.Event)}


def test_record_counts_what_the_file_holds(capsys, tmp_path: Path) -> None:
    out = tmp_path / "a.mcap"
    # a board that does not wait for time sends some more until it hears STOP
    assert main(["record", "sim:press.toml", str(out), "--seconds", "1", "--json"]) == 0
    frames = json.loads(capsys.readouterr().out)["frames"]
    assert main(["check", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["frames"] == frames


def test_record_tells_faults_of_its_time_only(capsys, tmp_path: Path) -> None:
    world = tmp_path / "loose.toml"
    world.write_text(
        'name = "loose"\nseed = 1\nfingers = 1\n[[step]]\ndo = "rest"\nseconds = 1.0\n'
        '[[fault]]\nat_s = 0.5\nseconds = 0.01\nfinger = 0\nkind = "no_channel"\nchannel = "TDC"\n'
    )
    assert main(["record", f"sim:{world}", str(tmp_path / "a.mcap"), "--json"]) == 0
    faults = json.loads(capsys.readouterr().out)["faults"]  # and not that it was switched on before
    assert [line.partition(",")[0] for line in faults] == ["index: TDC_MISSING"]


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("fly", "invalid choice: 'fly'"),
        *((f"stream P --seconds {text}", "expected") for text in ("0", "-1", "nan", "inf", "soon")),
        ("stream P --rate 1e-308", "expected"),
        ("export rec.mcap out --partition -j 1.5", "-j: seen '1.5'; expected a whole number, 1 to 1024"),
        ("calibrate press P --scale --readings 1,nan", "seen '1,nan'; expected numbers, separated by commas"),
        ("calibrate clear P --finger 5", "expected one of 'index', 'middle', 'ring', 'little', 'thumb', or 0 to 4"),
        ("calibrate press P --pressure --finger thumb,9", "expected one of 'index', 'middle'"),
        ("record P OUT --forc", "unrecognized arguments: --forc"),
        ("check OUT --js", "unrecognized arguments: --js"),
    ],
)
def test_usage_errors_exit_2(capsys, command: str, message: str) -> None:
    with pytest.raises(SystemExit) as refused:
        main(command.split())
    assert refused.value.code == 2
    assert message in capsys.readouterr().err.splitlines()[-1]


def test_without_a_verb_all_are_listed(capsys) -> None:
    assert main([]) == 2
    listed = capsys.readouterr().err
    assert all(f"\n    {verb} " in listed for verb in VERBS)


def test_an_old_verb_works_and_names_the_new_one(capsys) -> None:
    assert main(["calibration", "show", "sim:press.toml?fingers=1"]) == 0
    said = capsys.readouterr()
    assert "board's settings apply" in said.out and "`biotac calibration` is now `biotac calibrate`" in said.err


def test_a_full_disk_exits_2_in_one_line() -> None:
    done = run("record", "sim:press.toml", "/dev/full", "--force", "--seconds", "5")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1) and "No space left" in done.stderr


@contextlib.contextmanager
def simulated(link: Path, *options: str) -> Iterator[str]:
    """A board on a pty that ``link`` leads to; gives the command's output for it."""
    arguments = [sys.executable, "-m", "biotac", "sim", "press.toml", "--link", str(link), *options]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield process.stdout.readline()
        finally:
            process.terminate()
    assert not link.is_symlink()


def test_sim_gives_a_pty_that_any_program_can_open(tmp_path: Path) -> None:
    link = tmp_path / "board"
    with simulated(link, "--fingers", "2", "--json") as output:
        port = json.loads(output)["port"]
        assert link.resolve() == Path(port)
        fd = os.open(port, os.O_RDONLY | os.O_NOCTTY)
        assert termios.tcgetattr(fd)[6][termios.VMIN] == 1  # a program that sets nothing waits for the first byte
        os.close(fd)
        second = run("sim", "press.toml", "--link", str(link))
        assert (second.returncode, "choose another --link" in second.stderr) == (3, True)
        with biotac.open(str(link)) as hand:
            frames = hand.read(0.2)
        assert len(frames) == 40
        with biotac.open(port) as again:  # a port that was closed opens again
            assert again.info.fingers_present == 0b11


@pytest.mark.parametrize(("more", "plays"), [([], 2), (["--once"], 1)])
def test_view_once_plays_once(more: list[str], plays: int, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[dict[str, Any]] = []

    def browser(url: str) -> None:
        with urlopen(url.partition("#")[0] + "events") as events:
            for line in (line for line in events if line.startswith(b'data: {"frames"')):
                seen.append(json.loads(line.removeprefix(b"data: "))["health"] or seen[-1])
                if seen[-1]["epoch"] == 2 or seen[-1]["link"] == "over":
                    raise KeyboardInterrupt

    monkeypatch.setattr(webbrowser, "open", browser)
    assert main(["view", "sim:press.toml?seconds=0.1", "--port", "0", *more]) == 130
    assert max(health["epoch"] for health in seen) == plays
