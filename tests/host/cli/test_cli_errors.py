"""Each verb's ways to fail, one a line: the fixed exit code, and one line on stderr with the cure.

Failures that take a staged device stand with that device (test_flash.py, test_eeprom.py, test_emulated.py,
test_doctor.py), those that argparse refuses in test_cli.py.
"""

import gzip
import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fake_flash_board import plug_in
from maps import make_map

import biotac
from biotac import errors
from biotac.cli.main import VERBS, main
from biotac.documents import sealed
from biotac.map import file as map_file
from biotac.wire import messages_gen as wire
from biotac.wire.framing import encode

NO_PORT = "/dev/ttyNOWHERE7"
PORTS = (
    "a device path, serial:NUMBER, uart:DEVICE?baud=N, spidev:BUS.DEVICE, socket://HOST:PORT, rfc2217://HOST:PORT, "
    "sim:SOURCE, replay:REC; or bag:, btd:, csv:, "
)
#: Verbs with no BiotacError of their own, and why.
NEVER = {"list": "a port that fails is a fact of its own line", "doctor": "what fails is a finding"}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Files and folders by the names that the cases use."""
    folder = tmp_path_factory.mktemp("errors")
    names = {name: folder / name for name in ("rec.mcap", "empty.mcap", "cut.mcap", "text.mcap", "dead.mcap", "dir")}
    with biotac.open("sim:press.toml?seconds=1") as hand:
        hand.record(names["rec.mcap"])
        hand.read(2.0)
    with biotac.open("sim:press.toml?seconds=1") as hand:
        hand.record(names["empty.mcap"])
    names["cut.mcap"].write_bytes(names["rec.mcap"].read_bytes()[:100])
    names["text.mcap"].write_text("no recording\n")
    names["dir"].mkdir()
    names["pipe.npz"] = folder / "pipe.npz"
    os.mkfifo(names["pipe.npz"])
    names["done"] = folder / "done"
    names["done"].mkdir()
    (names["done"] / "shear.md").write_text("precious")
    names["rest.npz"] = folder / "rest.npz"
    np.savez(names["rest.npz"], E=np.full((40, 19), 3000), F=np.zeros((40, 3)))
    names["brief.npz"] = folder / "brief.npz"
    np.savez(names["brief.npz"], E=np.full((5, 19), 3000), F=np.ones((5, 3)))
    for name, text in {
        "bad.toml": "name = 'x'\n",
        "list.json": "[]",
        "none.json": '{"no_such_setting": 1}',
        "broken.json": "{",
        "none.btd": "no such file",
        "text.uf2": "none",
        "settings.json": '{"format": "another"}',
        "counts.json": '{"format": "another"}',
        "other.json": json.dumps(calibration("BT999")),
        "map.json": json.dumps(sealed(map_file.to_dict(make_map(1, serial="BT999")))),
    }.items():
        names[name] = folder / name
        names[name].write_text(text)
    return names


def calibration(serial: str) -> dict[str, object]:
    """A calibration file of the sensor with this serial number."""
    from biotac.keep import calibration_file as file

    return json.loads(file.dumps(biotac.Calibration(serial=serial), {}))


# "@name" is a file of the fixture, "+name" one that does not exist, in a separate folder for each case.
CASES: list[tuple[int, str, str]] = [
    (2, "expected a scenario's path or one of", "demo nowhere.toml --out +out"),
    (2, "expected 1 to 5", "demo press.toml --fingers 9 --out +out"),
    (2, "not a file", "demo @pipe.npz --out +out"),
    (2, "choose another --out", "demo press.toml --seconds 1 --out @list.json"),
    (2, "add one", "demo @bad.toml --out +out"),
    (3, "`biotac list`", f"info {NO_PORT}"),
    (2, "expected a file written by `biotac record`", "info list.json.csv"),
    (3, "plug one in", "info serial:FFFF"),
    (3, f"expected {PORTS}", "info telnet:1"),
    (3, "expected BUS.DEVICE", "info spidev:zero"),
    (3, "expected emu:pico", "info emu:teensy?source=press.toml"),
    (3, "expected sim:SOURCE?pace=X&fingers=N", "info sim:press.toml?finger=2"),
    (3, "an example is replay:", "info replay:@rec.mcap?pace=quick"),
    (2, "expected a scenario's path or one of", "info sim:nowhere.toml"),
    (2, "check the path", "info replay:+no.mcap"),
    (2, "expected 0 <= from", "info replay:@rec.mcap?from=99"),
    (3, "play it with replay:", "stream @rec.mcap"),
    (3, "play it with sim:", "stream press.toml"),
    (2, "then use `biotac export`", "record sim:press.toml +new.csv"),
    (2, 'or "biotac-wrench-map/1"', "calibrate show @none.json"),
    (2, "expected 0 to 65535", "view sim:press.toml --port 70000"),
    (2, "record it again", "view @empty.mcap --no-browser --json"),
    (2, "check the path", "view +no.mcap --no-browser"),
    (2, "expected a scenario's path or one of", "view sim:nowhere.toml --no-browser"),
    (2, "name another with --folder", "view sim:press.toml --no-browser --folder +no/where"),
    (3, "`biotac list`", f"stream {NO_PORT}"),
    (3, "expected sim:SOURCE?pace=X", "stream sim:press.toml?pace=quick"),
    (3, "option 'seconds' has no value; expected sim:", "stream sim:press.toml?seconds="),
    (3, "option 'pace' has no value", "stream sim:press.toml?pace"),
    (3, "expected socket://HOST:PORT", "info socket:nowhere"),
    (3, "check host and port", "info rfc2217:nowhere"),
    (3, "`biotac list`", f"share {NO_PORT} --lsl"),
    (2, "expected up to 64 letters", "share sim:press.toml --zenoh left/right"),
    (2, "already shared; open it directly", "share zenoh:left --zenoh right"),
    (2, "--seconds is for --lsl", "share sim:press.toml --zenoh left --seconds 1"),
    (2, "--listen is for --zenoh", "share sim:press.toml --lsl --listen tcp/0.0.0.0:7447"),
    (3, "`biotac list --zenoh`", "info zenoh:left?write=maybe"),
    (3, "`biotac list`", f"record {NO_PORT} +out.mcap"),
    (2, "overwrite it (--force", "record sim:press.toml @rec.mcap"),
    (2, "name a file in it", "record sim:press.toml @dir"),
    (2, "choose another folder", "record sim:press.toml +no/where.mcap"),
    (2, "check the path", "check +no.mcap"),
    (2, "expected", "check @text.mcap"),
    (2, "record it again", "check @cut.mcap"),
    (2, "check the path", "calibrate wrench +no.npz"),
    (3, "`biotac list`", f"calibrate press {NO_PORT} --pressure"),
    (2, "check the path", "calibrate press +no.mcap --pressure"),
    (2, "expected a reference file", "calibrate press @rec.mcap --pressure"),
    (2, "expected a CSV file of a force/torque sensor", "calibrate press @rec.mcap --pressure +no.csv"),
    (2, "expected .csv, .tsv, .txt, or .mcap", "calibrate press @rec.mcap --pressure @list.json"),
    (2, "press harder", "calibrate press @rec.mcap --pressure --readings 2,3,4,3"),
    (2, "expected 4 or more", "calibrate press @rec.mcap --pressure --readings 2,3,4"),
    (2, "expected --finger NAME", "calibrate press sim:fingers.toml --scale"),
    (2, "as `biotac-lab population", "calibrate population sim:press.toml --finger 0 --population @list.json"),
    (2, "needs a recording", "calibrate press sim:fingers.toml --pressure @list.json"),
    (2, "--save needs a board", "calibrate press @rec.mcap --pressure --save"),
    (2, "are there); check its cable", "calibrate press sim:press.toml --pressure --finger thumb"),
    (2, "is not a folder", "calibrate press sim:fingers.toml --pressure --out @list.json"),
    (2, "add --reference FILE", "calibrate wrench @text.mcap"),
    (2, "expected a CSV file of a force/torque sensor", "calibrate wrench @rec.mcap --reference +no.csv"),
    (2, "expected one topic of geometry_msgs", "calibrate wrench @rec.mcap --reference @rec.mcap --mounting lin"),
    (2, "expected one for each", "calibrate wrench +no.npz --reference +no.csv"),
    (2, "expected TOML with rotation", "calibrate wrench @rec.mcap --reference +no.csv --mounting +no.toml"),
    (2, "expected either FILE... or --live PORT", "calibrate wrench"),
    (2, "expected either FILE... or --live PORT", "calibrate wrench +no.npz --live sim:press.toml"),
    (2, "expected --finger NAME", "calibrate wrench --live sim:press.toml"),
    (2, "expected --out FOLDER", "calibrate wrench --live sim:press.toml --finger 0"),
    (2, "check its cable", "calibrate wrench --live sim:press.toml --finger thumb --out +o"),
    (2, "expected one, a .csv or nano17", "calibrate wrench --live sim:press.toml --finger 0 --out +o"),
    (2, "no header line", "calibrate wrench --live sim:press.toml --finger 0 --out +o --reference /dev/null"),
    (2, "cannot be read", "calibrate wrench --live sim:press.toml --finger 0 --out +o --reference +no.csv"),
    (3, "`biotac list`", f"calibrate wrench --live {NO_PORT} --finger 0 --out +o --reference nano17"),
    (
        2,
        "use this sensor's own",
        "calibrate wrench --live sim:press.toml --finger 0 --out +o --reference nano17 --serial BTX",
    ),
    (2, "check the path", "sim +no.mcap"),
    (2, "drop it", "sim @rec.mcap --fingers 2"),
    (2, "check the path", "export --recompute +no.mcap +out.mcap"),
    (2, "nothing to recompute", "export --recompute @empty.mcap +out.mcap"),
    (2, "overwrite it (--force", "export --recompute @rec.mcap @text.mcap"),
    (2, "expected an object", "export --recompute @rec.mcap +out.mcap --settings @broken.json"),
    (2, "expected one such as", "export --recompute @rec.mcap +out.mcap --settings @list.json"),
    (2, "expected one of poc_weights", "export --recompute @rec.mcap +out.mcap --settings @none.json"),
    (2, "check the path", "export +no.mcap +out.csv"),
    (2, "nothing to export", "export @empty.mcap +out.csv"),
    (2, "expected .csv", "export @rec.mcap +out.xyz"),
    (2, "overwrite it (--force", "export @rec.mcap @list.json.csv"),
    (2, "choose another place", "export @rec.mcap +no/where.csv"),
    (2, "add --partition and name a folder", "export @rec.mcap"),
    (2, "name the folder to write to", "export --partition @rec.mcap"),
    (3, "`biotac list` shows the ports", f"sim --sensor-port {NO_PORT}"),
    (2, "check the path", "export +no.btd +out.mcap"),
    (2, "expected a SynTouch .btd", "export @none.btd +out.mcap"),
    (2, "overwrite it (--force", "export @none.btd @rec.mcap"),
    (3, "expected one such as 1:0x50:24c32", "calibrate show i2c:1:0x50"),
    (2, "check the path", "calibrate show +no.json"),
    (2, "as `biotac calibrate get` and", "calibrate show @list.json"),
    (3, "`biotac list`", f"calibrate show {NO_PORT}"),
    (2, "upload one with `put`", "calibrate get sim:drift.toml +out.json --finger index"),
    (7, "or send no serial number to force it", "calibrate put sim:press.toml @other.json --finger 0"),
    (2, "check the path", "calibrate put sim:press.toml +no.json --finger 0"),
    (3, "expected BUS:ADDRESS", "calibrate put i2c:here:24c02 @other.json"),
    (2, "is a wrench map, which no EEPROM holds", "calibrate put i2c:1:0x50:24c02 @map.json"),
    (3, "check its address pins", "calibrate get i2c:1:0x20:24c02 +out.json"),
    (2, "use a 24c02", "calibrate get i2c:1:0x50:24c01 +out.json"),
    (2, "no wrench map; the recording has none", "calibrate get @rec.mcap +out.json --finger thumb --kind map"),
    (2, "no calibration and no wrench map; the", "calibrate get replay:@rec.mcap +out.json --finger thumb"),
    (2, "name one with --finger", "calibrate get sim:press.toml +out.json"),
    (2, "expected JSON of `biotac calibrate get`", "calibrate put sim:press.toml @broken.json --finger 0"),
    (7, "or send no serial number to force it", "calibrate put sim:press.toml @map.json --finger 0"),
    (2, "expected a scenario's path or one of", "sim nowhere.toml"),
    (2, "expected 1 to 5", "sim press.toml --fingers 0"),
    (2, "--pace is 0, expected above 0", "sim press.toml --pace fast"),
    (2, "add --board pico", "sim press.toml --image @text.uf2"),
    (3, "choose another path", "sim press.toml --link @dir"),
    (2, "use only one", "flash --backup +out.json --no-backup"),
    (2, "drop one of them", f"flash --emulated {NO_PORT} @text.uf2"),
    (2, "MCAP file", "file cut @text.uf2 +part.mcap"),
    (2, "expected an image, .uf2", f"flash {NO_PORT} +no.uf2"),
    (2, "use the build's .uf2", f"flash {NO_PORT} @text.uf2"),
    (2, "no SOURCE is given", "sim"),
    (2, "no fault 'loose', expected one of", "sim press.toml --sensor-port /dev/null --fault 2=loose"),
    (2, "--link is for a board on a pty", "sim press.toml --sensor-port /dev/null --link +link"),
    (2, "press has 1, expected 0 to 0", "sim press.toml --fault 2=none"),
    (2, "name an IMAGE", "flash"),
]


def line_of(capsys: pytest.CaptureFixture[str], code: int, arguments: list[str]) -> str:
    """Run a command that has to fail with this code and one line."""
    assert main(arguments) == code
    lines = [line for line in capsys.readouterr().err.splitlines() if not line.startswith("\r")]
    assert len(lines) == 1
    assert lines[0].startswith("biotac: ")
    return lines[0]


def placed(command: str, files: dict[str, Path], folder: Path) -> list[str]:
    """The words of a case with the files in place."""
    arguments = []
    for word in command.split():
        for mark in ("@", "+"):
            head, found, rest = word.partition(mark)
            if found:
                name, question, query = rest.partition("?")
                target = files.get(name, folder / name) if mark == "@" else folder / name
                word = f"{head}{target}{question}{query}"
        arguments.append(word)
    return arguments


@pytest.mark.parametrize(("code", "cure", "command"), CASES, ids=[command for _, _, command in CASES])
def test_it_fails_with_its_code_and_the_cure(
    capsys, tmp_path: Path, files: dict[str, Path], monkeypatch, code: int, cure: str, command: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "list.json.csv").write_text("precious")
    assert cure in line_of(capsys, code, placed(command, files, tmp_path))
    assert (tmp_path / "list.json.csv").read_text() == "precious"
    assert sorted(os.listdir(tmp_path)) == ["list.json.csv"]  # a command that fails leaves nothing behind


def test_every_verb_and_every_code_has_a_case() -> None:
    assert {command.split()[0] for _, _, command in CASES} == set(VERBS) - set(NEVER)
    codes = {c.exit_code for c in vars(errors).values() if isinstance(c, type) and issubclass(c, errors.BiotacError)}
    staged = {4, 5, 6}  # below
    with_device = {8}  # test_flash.py
    unfit = {errors.BiotacError.exit_code}  # the base class, never raised
    assert codes - staged - with_device - unfit == {code for code, _, _ in CASES}


# ---- failures that take a board on the port ---------------------------------------------------------

OPENERS = [
    "info PORT",
    "stream PORT",
    "share PORT --lsl",
    "record PORT out.mcap",
    "calibrate show PORT",
    "calibrate get PORT out.json --finger 0",
    "calibrate put PORT MAP --finger 0",
]
Make = Callable[..., object]


def opened(command: str, port: str, files: dict[str, Path]) -> list[str]:
    return command.replace("PORT", port).replace("MAP", str(files["map.json"])).split()


@pytest.mark.parametrize("command", OPENERS)
def test_a_stranger_on_the_port_is_4(
    capsys, scripted_board, time_passes, files, tmp_path, monkeypatch, command: str
) -> None:
    monkeypatch.chdir(tmp_path)
    board = scripted_board(lambda i, p: b"OK\r\n" + time_passes())
    message = line_of(capsys, 4, opened(command, board.path, files))
    assert "bytes arrived that are not frames" in message and "check that this is the board's port" in message
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("command", OPENERS)
@pytest.mark.parametrize(("major", "cure"), [(wire.WIRE_MAJOR + 1, "pip install -U"), (0, "biotac flash")])
def test_another_wire_is_5(
    capsys, scripted_board, hello, files, tmp_path, monkeypatch, command: str, major: int, cure: str
) -> None:
    monkeypatch.chdir(tmp_path)
    board = scripted_board(lambda i, p: hello(p, wire_major=major) if i == wire.HelloRequest.ID else b"")
    assert cure in line_of(capsys, 5, opened(command, board.path, files))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("command", ["info PORT", "record PORT out.mcap"])
def test_a_board_that_falls_silent_is_6(
    capsys, scripted_board, hello, time_passes, files, tmp_path, monkeypatch, command
) -> None:
    monkeypatch.chdir(tmp_path)

    def answer(message_id: int, payload: bytes) -> bytes:
        if message_id == wire.HelloRequest.ID:
            return hello(payload)
        return b"" if message_id == wire.Stop.ID else time_passes()

    board = scripted_board(answer)
    assert "check the cable and open it again" in line_of(capsys, 6, opened(command, board.path, files))


@pytest.mark.parametrize("command", OPENERS)
def test_a_refusal_is_7(capsys, scripted_board, hello, files, tmp_path, monkeypatch, command: str) -> None:
    monkeypatch.chdir(tmp_path)

    def answer(message_id: int, payload: bytes) -> bytes:
        if message_id == wire.HelloRequest.ID:
            return hello(payload)
        return encode(wire.Reply.ID, wire.Reply(payload[0], message_id, wire.Error.UNKNOWN_COMMAND).pack())

    message = line_of(capsys, 7, opened(command, scripted_board(answer).path, files))
    assert "update it" in message


# ---- failures that take another computer ------------------------------------------------------------


@pytest.mark.parametrize(
    ("numbers", "cure"), [({}, "try `biotac demo`"), ({"/dev/ttyACM0": "A", "/dev/ttyACM1": "B"}, "name one of them")]
)
def test_view_without_a_port_needs_exactly_one_board(capsys, monkeypatch, numbers: dict[str, str], cure: str) -> None:
    plug_in(monkeypatch).update(numbers)  # beside a serial port that is none of ours
    assert cure in line_of(capsys, 3, ["view", "--no-browser"])


def test_a_recording_on_a_pty_needs_ptys(capsys, files, monkeypatch) -> None:
    def none_left() -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.openpty", none_left)
    assert "use replay:" in line_of(capsys, 3, ["sim", str(files["rec.mcap"])])


def test_a_board_that_was_a_process(capsys) -> None:
    assert "it is in this program now, and is called sim" in line_of(
        capsys, 2, ["sim", "press.toml", "--board", "posix"]
    )


@pytest.mark.parametrize("command", ["", "/no/where"])
def test_an_emulated_board_without_its_command(command: str, capsys, monkeypatch) -> None:
    monkeypatch.setenv("BIOTAC_SIM", command)
    assert "expected the command of a board" in line_of(capsys, 3, ["info", "emu:command?source=press.toml"])


def test_an_emulated_board_that_does_not_start(capsys, monkeypatch, tmp_path) -> None:
    broken = tmp_path / "broken"
    broken.write_text("#!/bin/sh\necho it is broken >&2\n")
    broken.chmod(0o755)
    monkeypatch.setenv("BIOTAC_SIM", str(broken))
    assert "it is broken" in line_of(capsys, 3, ["info", "emu:command?source=press.toml"])


def test_a_btd_without_end(capsys, tmp_path) -> None:
    (tmp_path / "long.btd.gz").write_bytes(gzip.compress(b"Begin File\n" + b"0\n" * 9_000_000))
    message = line_of(capsys, 2, ["export", str(tmp_path / "long.btd.gz"), str(tmp_path / "a.mcap")])
    assert "holds more than 16 MiB of text" in message and "split it" in message
