"""The largest stack depth of a linked image: frames from gcc's -fstack-usage, calls from the disassembly.

Library functions have no .su file; their frame is the sum of all they push. A call through a pointer is identified by
the source line, in whatever function the compiler put it. The board's list must name the functions that it may call,
or the depth is unknown and the build fails.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

HEAD = re.compile(r"^([0-9a-f]+) <(.+)>:$")
LINE = re.compile(r"^\s*[0-9a-f]+:\t[0-9a-f ]+\t(\S+)\s*(.*)$")
TARGET = re.compile(r"[0-9a-f]+ <([^+>]+)>")
CLONE = re.compile(r"\.(isra|constprop|part|cold|lto_priv)(\.\d+)?")
VENEER = re.compile(r"__(.+)_veneer$")
WHERE = re.compile(r"^(/.+):(\d+)(?: \(discriminator \d+\))?$")
BRANCHES = re.compile(r"(bl|b(eq|ne|cs|cc|mi|pl|vs|vc|hi|ls|ge|lt|gt|le)?)(\.[nw])?$")


class Unknown(Exception):
    """The depth cannot be determined; one sentence says why."""


@dataclass
class Function:
    address: int
    pushed: int = 0
    calls: set[str] = field(default_factory=set)
    indirect: set[str] = field(default_factory=set)  # FILE:LINE of calls through a pointer


def read_functions(listing: Iterable[str]) -> dict[str, Function]:
    """Functions of an `objdump -dl` by name; those of the same name are merged."""
    functions: dict[str, Function] = {}
    name = where = ""
    for line in listing:
        if head := HEAD.match(line):
            name, where = head.group(2), ""
            functions.setdefault(name, Function(int(head.group(1), 16)))
        elif match := WHERE.match(line):
            where = f"{match.group(1)}:{match.group(2)}"
        elif name and (found := LINE.match(line)):
            operands = found.group(2).split("@")[0].split(";")[0].strip()
            read_line(functions[name], name, where, found.group(1), operands)
    return functions


def read_line(function: Function, name: str, where: str, instruction: str, operands: str) -> None:
    veneer = VENEER.match(name)
    if veneer:
        function.calls.add(veneer.group(1))
    if instruction == "push":
        function.pushed += 4 * count_registers(operands)
    elif instruction == "sub" and operands.startswith("sp,"):
        function.pushed += int(operands.split("#")[-1].split()[0], 0)
    elif BRANCHES.match(instruction):
        target = TARGET.search(operands)
        if target and target.group(1) != name:
            function.calls.add(target.group(1))
    elif (instruction == "blx" or (instruction == "bx" and operands not in ("lr", "pc"))) and not veneer:
        function.indirect.add(where)


def source_line(where: str) -> str | None:
    """The text of FILE:LINE; None if objdump gave none (no -g), or the file is not here (a library's)."""
    path, _, line = where.rpartition(":")
    try:
        return Path(path).read_text(encoding="utf-8").splitlines()[int(line) - 1].strip()
    except (OSError, ValueError, IndexError):
        return None


def count_registers(operands: str) -> int:
    count = 0
    for part in operands.strip("{}").split(","):
        ends = [int(n) for n in re.findall(r"r(\d+)", part)]
        count += ends[1] - ends[0] + 1 if len(ends) == 2 else 1
    return count


def read_usage(folder: Path) -> dict[str, int]:
    """Frames by function name from every .su file below ``folder``; the largest for functions of the same name."""
    frames: dict[str, int] = {}
    for path in folder.rglob("*.su"):
        for line in path.read_text(encoding="utf-8").splitlines():
            where, size, kind = line.split("\t")
            if kind != "static" and "bounded" not in kind:
                raise Unknown(f"{where}: stack frame is {kind}: expected static or bounded")
            name = CLONE.sub("", where.rsplit(":", 1)[1])
            frames[name] = max(frames.get(name, 0), int(size))
    return frames


@dataclass
class Program:
    functions: dict[str, Function]
    frames: Mapping[str, int]
    pointers: Mapping[str, tuple[str, ...]]  # functions that a source line with the key may call

    def named(self, name: str) -> str:
        """The function's name in the image, where the compiler may have renamed it as a variant."""
        found = [key for key in self.functions if CLONE.sub("", key) == name]
        if len(found) != 1:
            raise Unknown(f"{len(found)} functions in the image are called {name}: expected one")
        return found[0]

    def frame(self, name: str) -> int:
        return self.frames.get(CLONE.sub("", name), self.functions[name].pushed)

    def callees(self, name: str) -> set[str]:
        function = self.functions[name]
        return function.calls.union(*(self.through_pointer(name, where) for where in function.indirect))

    def through_pointer(self, name: str, where: str) -> tuple[str, ...]:
        line = source_line(where)
        if line is None:
            raise Unknown(f"{name} calls through a pointer at '{where}', no line of source found there")
        for call, targets in self.pointers.items():
            if call in line:
                return targets
        raise Unknown(f"{name} calls through a pointer at {where}: {line}; add to POINTERS in tools/image/check.py")

    def deepest(self, name: str, above: tuple[str, ...] = ()) -> tuple[int, tuple[str, ...]]:
        """The most bytes it needs, and the chain of calls that needs them."""
        if name in above:
            raise Unknown(f"recursion: {' -> '.join([*above, name])}")
        if name not in self.functions:
            raise Unknown(f"no function {name} in the image, called by {above[-1] if above else 'nobody'}")
        best: tuple[int, tuple[str, ...]] = (0, ())
        for callee in self.callees(name):
            best = max(best, self.deepest(callee, (*above, name)))
        return best[0] + self.frame(name), (name, *best[1])

    def reached(self, name: str) -> set[str]:
        """This function and all it can call."""
        seen: set[str] = set()
        todo = [name]
        while todo:
            at = todo.pop()
            if at not in seen:
                seen.add(at)
                todo += self.callees(at)
        return seen


def load(elf: Path, objdump: str, usage: Path, pointers: Mapping[str, tuple[str, ...]]) -> Program:
    """The Program of an ELF file and the build's .su files."""
    done = subprocess.run([objdump, "-dl", str(elf)], capture_output=True, text=True, check=True)
    return Program(read_functions(done.stdout.splitlines()), read_usage(usage), pointers)
