"""`biotac sim` with each board that is a program: a pty that any serial program can open."""

import json
import subprocess
import sys
from pathlib import Path

import biotac


def test_sim_gives_a_pty_for_this_board(rig, tmp_path: Path) -> None:
    rig.need("scenarios")
    rig.need("starting")
    link = tmp_path / "ttyBOARD"
    command = [sys.executable, "-m", "biotac", "sim", "press.toml", "--fingers", "2", "--link", str(link), "--json"]
    process = subprocess.Popen([*command, "--board", rig.facts["board"]], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        facts = json.loads(process.stdout.readline())
        assert str(link.resolve()) == facts["port"]
        with biotac.open(link) as hand:
            assert hand.fingers == [0, 1]
            frames = hand.read(0.3)
            assert len(frames) == 60
            assert hand.stats.crc_errors == 0
    finally:
        process.terminate()
        process.wait()
        process.stdout.close()


def test_an_image_that_is_none_is_refused_in_one_sentence(rig, tmp_path: Path) -> None:
    rig.need("counters")
    image = tmp_path / "noise.bin"
    image.write_bytes(bytes(range(256)) * 8)
    command = [sys.executable, "-m", "biotac", "info", f"emu:pico?source=press.toml&image={image}"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 3
    assert "second-stage boot" in done.stderr
    assert done.stderr.count("\n") == 1


def test_sim_with_a_time_ends_by_itself_and_has_the_faults_it_is_given(tmp_path: Path) -> None:
    link = tmp_path / "ttyBOARD"
    command = [sys.executable, "-m", "biotac", "sim", "press.toml", "--seconds", "10", "--link", str(link)]
    with subprocess.Popen([*command, "--fault", "0=open@E3"], stdout=subprocess.PIPE, text=True) as board:
        assert board.stdout is not None
        ready = board.stdout.readline()
        assert str(link.resolve()) in ready and "plays press" in ready
        with biotac.open(link) as hand:
            assert (hand.read(0.3)["counts"][:, 2] == 4095).all()
        assert board.wait(300) == 0
        assert board.stdout.read() == "" and not link.exists()
