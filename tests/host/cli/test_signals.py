"""Every verb, every signal, at random moments: the verb ends soon, by a documented code, without a traceback,
and the recording is whole. BIOTAC_SEED chooses the moments; by night there are twenty of each."""

import fcntl
import itertools
import os
import pty
import random
import shutil
import signal
import subprocess
import sys
import termios
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

import biotac
from biotac.cli.main import main
from biotac.cli.progress import Progress

LONG = "sim:grasp.toml?seconds=600&pace=1"
# Each begins by itself, runs for longer than the signal, and may have ended when that comes.
VERBS: dict[str, list[str]] = {
    "list": ["list"],
    "doctor": ["doctor", LONG],
    "info": ["info", LONG],
    "info, recorded": ["info", "REC"],
    "stream": ["stream", LONG],
    "record": ["record", LONG, "OUT.mcap", "--force"],
    "record fast": ["record", "sim:grasp.toml?seconds=100", "OUT.mcap", "--force"],
    "check": ["check", "REC"],
    "export": ["export", "REC", "OUT.csv", "--force"],
    "recompute": ["export", "REC", "OUT2.mcap", "--force", "--recompute"],
    "partition, two jobs": ["export", "REC", "REC2", "MANY", "--partition", "--force", "-j", "2"],
    "cut": ["file", "cut", "REC", "OUT3.mcap", "--force"],
    "sim": ["sim", "press.toml"],
    "view": ["view", LONG, "--no-browser", "--port", "0"],
    "demo": ["demo", "--json"],
    "share LSL": ["share", LONG, "--lsl"],
    "share Zenoh": ["share", LONG, "--zenoh", "signals"],
    "calibrate live": f"calibrate wrench --live {LONG} --finger 0 --reference nano17 --out FITTED".split(),
    "calibrate by hand": f"calibrate press {LONG} --plate --finger 0 --out OUT.wrench.json --force".split(),
    "flash": ["flash", "emu:pico?source=press.toml", "IMAGE"],
}
IMAGE = Path(__file__).parents[3] / "build/pico/biotac-pico.uf2"
HOW = {
    "Ctrl-C": (signal.SIGINT, True),
    "INT": (signal.SIGINT, False),
    "TERM to all": (signal.SIGTERM, True),
    "HUP to all": (signal.SIGHUP, True),
    "HUP": (signal.SIGHUP, False),
}
CODES = {0, 1, 130}  # done; done and found something, or less than asked for; interrupted
# Before it, Python itself has not come to our first line.
FIRST_LINE_S, LONGEST_S = 0.0, 3.0
FLASHING_S = 15.0  # settings, blocks, and the board's way back
LATE_S = 300.0  # half of LONG: by then the signal was not heard. However long a busy computer takes is no verdict


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("signals")
    assert main(["record", "sim:grasp.toml?seconds=30&fingers=5", str(folder / "a.mcap")]) == 0
    shutil.copy(folder / "a.mcap", folder / "b.mcap")
    return folder


def begun(words: list[str], folder: Path, *, ignored: bool = False) -> subprocess.Popen[str]:
    places = {"REC2": "b.mcap", "REC": "a.mcap", "MANY": "many", "IMAGE": str(IMAGE)}
    program = "import sys, biotac.cli.ending as e; e.by_leaving(); print('ready', file=sys.stderr, flush=True); "
    program += "from biotac.__main__ import program; sys.exit(program())"
    handler = signal.SIG_IGN if ignored else signal.SIG_DFL
    process = subprocess.Popen(
        [sys.executable, "-c", program, *(places.get(word, word) for word in words)],
        cwd=folder, text=True, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        preexec_fn=lambda: [signal.signal(number, handler) for number in (signal.SIGINT, signal.SIGHUP)],
    )  # fmt: skip
    assert process.stderr is not None and process.stderr.readline() == "ready\n"
    return process


def ended(process: subprocess.Popen[str], number: int, to_all: bool) -> tuple[int, str, float]:
    if process.poll() is None:
        (os.killpg if to_all else os.kill)(process.pid, number)
    sent_s = time.monotonic()
    _, output = process.communicate(timeout=LATE_S)
    return process.returncode, output, time.monotonic() - sent_s


def judge(folder: Path, code: int, output: str) -> str:
    """The fault in how the verb ended; empty if none."""
    if code not in CODES:
        return f"code {code}"
    if "Traceback" in output or "died" in output or "Exception" in output or "went away" in output:
        return "words"
    for path in [*folder.glob("FITTED/*.mcap"), *folder.glob("OUT*.mcap")]:
        if path.stat().st_size and (damage := biotac.Recording(path).damage):
            return f"{path.name}: {damage[0]}"
        path.unlink()
    shutil.rmtree(folder / "FITTED", ignore_errors=True)
    if parts := [path.name for pattern in (".*", "many/.*") for path in folder.glob(pattern)]:
        return f"left behind {parts}"
    return ""


def table(folder: Path, verbs: dict[str, list[str]], moments: int) -> list[str]:
    """Prints the table; returns the faults."""
    rng = random.Random(int(os.environ.get("BIOTAC_SEED", "54")))
    wrong: list[str] = []
    for verb, words in verbs.items():
        cells = []
        for how, (number, to_all) in HOW.items():
            slow_s, bad = 0.0, 0
            for _ in range(moments):
                process = begun(words, folder)
                moment_s = rng.uniform(FIRST_LINE_S, FLASHING_S if words[0] == "flash" else LONGEST_S)
                time.sleep(moment_s)
                code, output, took_s = ended(process, number, to_all)
                problem = judge(folder, code, output)
                slow_s, bad = max(slow_s, took_s), bad + bool(problem)
                if problem:
                    wrong.append(f"{verb}, {how} after {moment_s:.2f} s: {problem}; {output[-600:]}")
            cells.append(f"{moments - bad}/{moments}, {slow_s:.1f} s")
        print(f"| {verb} | {' | '.join(cells)} |", flush=True)
    return wrong


@pytest.mark.nightly  # by day signals at the moments below
@pytest.mark.parametrize("verb", VERBS)
def test_twenty_moments_of_each(folder: Path, verb: str) -> None:
    if verb == "flash" and not IMAGE.exists() and not os.environ.get("BIOTAC_CI"):
        pytest.skip(f"no {IMAGE}: cmake -S firmware --preset pico && cmake --build build/pico")
    assert table(folder, {verb: VERBS[verb]}, int(os.environ.get("BIOTAC_MOMENTS", "20"))) == []


def await_rows(process: subprocess.Popen[str], path: Path) -> None:
    """Until the verb has written some, behind the opening bytes of a recording."""
    sizes: set[int] = set()
    while len(sizes - {0}) < 2 and process.poll() is None:
        sizes.add(path.stat().st_size if path.exists() else 0)
        time.sleep(0.05)


def recording(folder: Path, *, ignored: bool = False) -> subprocess.Popen[str]:
    process = begun(VERBS["record"], folder, ignored=ignored)
    await_rows(process, folder / "OUT.mcap")
    return process


def test_an_ignored_signal_stays_ignored(folder: Path) -> None:
    """As by nohup, or behind & in a script; SIGTERM ends it."""
    process = recording(folder, ignored=True)
    os.kill(process.pid, signal.SIGINT)
    os.killpg(process.pid, signal.SIGHUP)
    time.sleep(1.0)
    assert process.poll() is None
    code, output, _ = ended(process, signal.SIGTERM, False)
    assert (code, judge(folder, code, output)) == (0, "")


def test_a_terminal_that_closes_ends_a_recording_as_ctrl_c_does(folder: Path) -> None:
    """Later output is then an error too, but no error of the verb's work."""
    terminal, inside = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "biotac", *VERBS["record"]], cwd=folder, text=True, start_new_session=True,
        stdin=inside, stdout=inside, stderr=subprocess.PIPE,
        preexec_fn=lambda: [signal.signal(signal.SIGHUP, signal.SIG_DFL), fcntl.ioctl(inside, termios.TIOCSCTTY, 0)],
    )  # fmt: skip
    os.close(inside)
    await_rows(process, folder / "OUT.mcap")
    os.close(terminal)
    _, output = process.communicate(timeout=LATE_S)
    assert (process.returncode, judge(folder, process.returncode, output)) == (0, "")
    assert "Errno" not in output


def test_a_terminal_that_closes_ends_no_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stderr", SimpleNamespace(isatty=lambda: True, write=lambda text: os.close(-1)))
    monkeypatch.setattr("time.monotonic", itertools.count().__next__)
    with Progress() as progress:
        progress.show("half")


def test_two_signals_are_one(folder: Path) -> None:
    process = recording(folder)
    os.killpg(process.pid, signal.SIGHUP)
    time.sleep(0.1)
    code, output, _ = ended(process, signal.SIGINT, True)
    assert judge(folder, code, output) == ""


def test_a_signal_that_an_import_would_swallow_is_put_off(tmp_path: Path) -> None:
    """As Cython does: registering classes clears the error raised meanwhile."""
    (tmp_path / "swallows.py").write_text(
        "import os, signal\ntry:\n    os.kill(os.getpid(), signal.SIGINT)\n    [0 for _ in range(1000)]\n"
        "except KeyboardInterrupt:\n    pass\n"
    )
    program = (
        "import signal, sys, time; signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # CI may ignore it
        f"sys.path.insert(0, {str(tmp_path)!r}); import biotac.cli.ending as e; e.by_interrupt()\n"
    )
    program += "try: import swallows; time.sleep(60)\nexcept KeyboardInterrupt: print('obeyed')"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=300)
    assert (run.stdout, run.stderr) == ("obeyed\n", "")
