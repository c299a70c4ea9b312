"""The emulated boards: builds their images, runs them, and reads their output."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import statistics
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import m4f_model
import m33_model
from m4f_model import UnknownInstruction, runs

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

import qemu  # noqa: E402
from qemu import Failed as Failed  # noqa: E402

ROOT = HERE.parent.parent
FIRMWARE = ROOT / "firmware"
BUILD = ROOT / "build" / "bench"
FRAMES = 12  # per weighting
BITS_FRAMES = 100_000 if os.environ.get("BIOTAC_NIGHTLY") else 20_000  # of the hash of all results
WEIGHTS = ("abs n=2", "compress n=1", "compress n=2")  # in the order of enum bt_poc_weights, as image.c counts
# Files that need other options than -O3; the boards' images are built from the same list.
OPTIONS = json.loads((FIRMWARE / "boards" / "compile_options.json").read_text(encoding="utf-8"))["files"]


def option_key(source: Path) -> str:
    """The file's name in compile_options.json."""
    return f"{source.parent.name}/{source.name}"


APART = [path for path in (FIRMWARE / "core").rglob("*.c") if option_key(path) in OPTIONS]
CORE = sorted(set((FIRMWARE / "core").rglob("*.c")) - set(APART))
JUDGED = sorted([*(FIRMWARE / "reference").glob("*.c"), *(ROOT / "tools/bench/kernels").glob("*.c")])
INCLUDE = [f"-I{FIRMWARE / room}" for room in ("core", "reference", "sensor", "port", "app")] + [
    f"-I{ROOT / 'tools/bench/kernels'}",
    f"-I{HERE}",
]
PACKAGES = {
    "arm-none-eabi-gcc": "gcc-arm-none-eabi libnewlib-arm-none-eabi",
    "qemu-system-arm": "qemu-system-arm",
    "node": "nodejs",
    "npm": "npm",
    "cc": "gcc",
}

Row = tuple[str, str, int, int]  # kernel, scene, instructions, cycles


@dataclass(frozen=True)
class Board:
    """A core in an emulator."""

    key: str
    title: str
    cycles_by: str
    machine: tuple[str, ...]
    start: tuple[Path, ...]
    script: Path
    options: tuple[str, ...] = ()
    qemu: str = ""  # the machine; without one, rp2040js runs the image


M0PLUS = ("-mcpu=cortex-m0plus",)
M4F = ("-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard")
RP2040JS = "rp2040js 1.4.1, by the Cortex-M0+ manual without flash wait states or bus contention"
M0PLUS_START = (HERE / "m0plus.c",)
REFERENCE = ROOT / "tests" / "target" / "m4f"  # the M4F's reset code and memory map are the board's
QEMU = "instructions counted in QEMU mps2-an386, cycles by a model of the Cortex-M4 manual without memory wait states"
M33 = ("-mcpu=cortex-m33", "-mfloat-abi=soft")  # as boards/pico2 is built
M33_BY = "instructions counted in QEMU mps2-an505, cycles by a model of the RP2350 data sheet without wait states"
BOARDS = (
    Board("m0plus", "Cortex-M0+", RP2040JS, M0PLUS, M0PLUS_START, HERE / "m0plus.ld"),
    Board("m4f", "Cortex-M4F", QEMU, M4F, (REFERENCE / "startup.c", HERE / "m4f.c"), REFERENCE / "m4f.ld",
          (f"-I{REFERENCE.parent}",), "mps2-an386"),
    Board("m33", "Cortex-M33", M33_BY, M33, (REFERENCE / "startup.c", HERE / "m4f.c"), BUILD / "m33.ld",
          (f"-I{REFERENCE.parent}",), "mps2-an505"),
)  # fmt: skip


# Addresses on mps2-an505 for those on mps2-an386: code, and Secure RAM.
AN505_AT = {"0x00000000": "0x10000000", "0x20000000": "0x38000000", "0x21000000": "0x38100000",
            "0x21100000": "0x38200000", "15M": "2M"}  # fmt: skip


def need() -> None:
    for tool, package in PACKAGES.items():
        if shutil.which(tool) is None:
            raise Failed(f"{tool} is missing; install it: apt-get install {package}")
    BUILD.mkdir(parents=True, exist_ok=True)
    script = (REFERENCE / "m4f.ld").read_text(encoding="utf-8")
    for here, there in AN505_AT.items():
        script = script.replace(here, there)
    (BUILD / "m33.ld").write_text(script, encoding="utf-8")
    installed, wanted = HERE.parent / "node_modules" / ".package-lock.json", HERE.parent / "package-lock.json"
    # Only if it is out of date: tools/emulator shares it and may be running.
    if not installed.is_file() or installed.stat().st_mtime < wanted.stat().st_mtime:
        command("npm", "ci", "--silent", "--prefix", HERE.parent)


def command(*arguments: object) -> str:
    done = subprocess.run([str(w) for w in arguments], cwd=HERE, capture_output=True, text=True)
    if done.returncode:
        raise Failed(f"{arguments[0]} failed: {(done.stderr or done.stdout).strip()}")
    return done.stdout


def of_bits(source: Path) -> bool:
    """Whether the hash of all results needs a file of the core."""
    return source.parent.name != "talk"


def build(board: Board, name: str, *sources: object, needs: Callable[[Path], bool] = lambda source: True) -> Path:
    """An image of these sources and the files of the core that it needs."""
    elf = BUILD / f"{board.key}_{name}.elf"
    compiler = ["arm-none-eabi-gcc", "-std=c11", "-mthumb", *board.machine, "-ffunction-sections", "-fdata-sections"]
    # As everywhere else: no products fused into sums, and no errno for a square root.
    compiler += ["-ffp-contract=off", "-fno-math-errno", f"-DBENCH_FRAMES={FRAMES}", f"-DBITS_FRAMES={BITS_FRAMES}"]
    compiler += [*INCLUDE, *board.options]
    link = ["-nostartfiles", "--specs=nano.specs", "-Wl,--gc-sections"]
    link += ["--specs=rdimon.specs" if board.qemu else "--specs=nosys.specs"]
    apart = []
    for source in filter(needs, APART):
        apart.append(elf.with_suffix(f".{source.parent.name}_{source.stem}.o"))
        command(*compiler, *OPTIONS[option_key(source)], "-c", source, "-o", apart[-1])
    command(*compiler, "-O3", *link, "-T", board.script, *board.start, *sources, *filter(needs, CORE), *apart,
            "-lm", "-o", elf)  # fmt: skip
    return elf


def addresses(elf: Path) -> dict[str, int]:
    cells = (line.split() for line in command("arm-none-eabi-nm", elf).splitlines())
    return {c[2]: int(c[0], 16) for c in cells if len(c) == 3}


def run_rp2040(elf: Path) -> tuple[list[Row], list[int]]:
    """Rows, and the results that the image computed."""
    flat = elf.with_suffix(".bin")
    command("arm-none-eabi-objcopy", "-O", "binary", elf, flat)
    at = addresses(elf)
    # a function that the image does not use is not in it; nothing runs at address 0
    watched = [f"{at.get(name, 0):x}" for name in ("bench_mark", "bench_name", "bench_result", "bench_end")]
    answer = json.loads(command("node", HERE / "count.mjs", flat, *watched))
    return [tuple(row) for row in answer["rows"]], answer["results"]


def qemu_output(board: Board, elf: Path) -> list[str]:
    """The lines that the image printed."""
    code, output = qemu.run(elf, machine=board.qemu)
    if code:
        raise Failed(f"{elf.name} exited with code {code} in QEMU: {output.strip()[-200:]}")
    return output.splitlines()


def cycles_of(code: m4f_model.Model | m33_model.Model, run: list[int]) -> int:
    # the closing mark follows the last instruction, and starts no pair
    if isinstance(code, m4f_model.Model):
        return code.cycles(Counter(pairwise(run)))
    return code.cycles(Counter(zip([run[0], run[0], *run], [run[0], *run], run, run[1:], strict=False)))


def run_qemu(board: Board, elf: Path) -> list[Row]:
    """Rows. QEMU runs twice: for the names of the runs, and for the instructions in them."""
    names = [tuple(line.split("\t")) for line in qemu_output(board, elf)]
    model = (m33_model if board.machine == M33 else m4f_model).Model(command("arm-none-eabi-objdump", "-d", elf))
    rows: list[Row] = []
    try:
        for k, run in enumerate(runs(_log(board, elf), addresses(elf)["bench_mark"])):
            rows.append((names[k][0], names[k][1], len(run), cycles_of(model, run)))
    except UnknownInstruction as unknown:
        raise Failed(str(unknown)) from None
    if len(rows) != len(names):
        raise Failed(
            f"QEMU's log has {len(rows)} of {len(names)} runs; use a QEMU that logs blocks, such as qemu-system-arm 7"
        )
    return rows


def _log(board: Board, elf: Path) -> Iterator[bytes]:
    """QEMU's log, one line per instruction, through a pipe, because it would take a gigabyte on disk."""
    reader, writer = os.pipe()
    arguments = [*qemu.argv(elf, board.qemu), "-singlestep", "-d", "exec,nochain", "-D", f"/dev/fd/{writer}"]
    process = subprocess.Popen(arguments, pass_fds=[writer], stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    os.close(writer)
    try:
        with open(reader, "rb") as log:
            while chunk := log.read(1 << 20):
                yield chunk
    finally:
        process.kill()
        process.wait()


def count(board: Board) -> list[Row]:
    elf = build(board, "count", HERE / "image.c", HERE / "scenes.c", *JUDGED)
    return run_qemu(board, elf) if board.qemu else run_rp2040(elf)[0]


def tally(rows: list[Row]) -> dict[str, dict[str, list[dict[str, int]]]]:
    """Kernel -> scene -> for each weighting, the median and largest counts over the frames."""
    counts: dict[tuple[str, str], list[tuple[int, int]]] = defaultdict(list)
    for kernel, scene, instructions, cycles in rows:
        counts[kernel, scene].append((instructions, cycles))
    empty_instructions, empty_cycles = counts.pop(("nothing", ""))[0]
    out: dict[str, dict[str, list[dict[str, int]]]] = defaultdict(dict)
    for (kernel, scene), pairs in counts.items():
        out[kernel][scene] = []
        for w in range(len(WEIGHTS)):
            some = pairs[w * FRAMES : (w + 1) * FRAMES]
            out[kernel][scene].append(
                {
                    "cycles": int(statistics.median(c for _, c in some)) - empty_cycles,
                    "cycles_max": max(c for _, c in some) - empty_cycles,
                    "instructions": int(statistics.median(i for i, _ in some)) - empty_instructions,
                }
            )
    return dict(out)


def counts() -> dict[str, Any]:
    """For every board: key -> title, source of the cycles, and the kernels' counts by tally().

    Kept in build/bench, because several figures are made of them, for as long as the sources and the compiler stay.
    """
    inputs = hashlib.sha256(command("arm-none-eabi-gcc", "--version").encode())
    sources = (p for folder in (FIRMWARE, HERE, REFERENCE) for p in folder.rglob("*.*") if p.suffix != ".pyc")
    for path in sorted(p for p in sources if p.is_file()):
        inputs.update(path.read_bytes())
    kept = BUILD / f"counts_{inputs.hexdigest()[:16]}.json"
    if not kept.exists():
        found = {
            board.key: {"title": board.title, "cycles_by": board.cycles_by, "kernels": tally(count(board))}
            for board in BOARDS
        }
        kept.write_text(json.dumps(found), encoding="utf-8")
    return dict(json.loads(kept.read_text(encoding="utf-8")))


def bits(board: Board) -> int:
    """The hash of the shipped kernels' results on this board."""
    elf = build(board, "bits", HERE / "bits_image.c", needs=of_bits)
    return int(qemu_output(board, elf)[0], 16) if board.qemu else run_rp2040(elf)[1][0]


def bits_here() -> int:
    """The same hash for this machine's own compiler."""
    program = BUILD / "bits"
    options = ["-std=c11", "-O2", f"-DBITS_FRAMES={BITS_FRAMES}", *INCLUDE]
    command("cc", *options, *filter(of_bits, [*CORE, *APART]), HERE / "bits.c", "-o", program)
    return int(command(program), 16)
