"""How deep a linked image's stack can get: frames from gcc's -fstack-usage, calls from the disassembly.

Library functions have no .su file; theirs are the sum of all they push. A call through a pointer must be
named in the board's list, or the depth is unknown and the build fails.
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
BRANCHES = re.compile(r"(bl|b(eq|ne|cs|cc|mi|pl|vs|vc|hi|ls|ge|lt|gt|le)?)(\.[nw])?$")


class Unknown(Exception):
    """The depth cannot be told; one sentence why."""


@dataclass
class Function:
    address: int
    pushed: int = 0
    calls: set[str] = field(default_factory=set)
    indirect: bool = False


def read_functions(listing: Iterable[str]) -> dict[str, Function]:
    """Functions of an `objdump -d`, by name; those of one name are taken together."""
    functions: dict[str, Function] = {}
    name = ""
    for line in listing:
        if head := HEAD.match(line):
            name = head.group(2)
            functions.setdefault(name, Function(int(head.group(1), 16)))
        elif name and (found := LINE.match(line)):
            read_line(functions[name], name, found.group(1), found.group(2).split("@")[0].split(";")[0].strip())
    return functions


def read_line(function: Function, name: str, instruction: str, operands: str) -> None:
    if instruction == "push":
        function.pushed += 4 * count_registers(operands)
    elif instruction == "sub" and operands.startswith("sp,"):
        function.pushed += int(operands.split("#")[-1].split()[0], 0)
    elif BRANCHES.match(instruction):
        target = TARGET.search(operands)
        if target and target.group(1) != name:
            function.calls.add(target.group(1))
    elif instruction == "blx" or (instruction == "bx" and operands not in ("lr", "pc")):
        function.indirect = not VENEER.match(name)
    if instruction == "bx" and operands == "pc" and (veneer := VENEER.match(name)):
        function.calls.add(veneer.group(1))
    if (veneer := VENEER.match(name)) and not function.calls:
        function.calls.add(veneer.group(1))


def count_registers(operands: str) -> int:
    count = 0
    for part in operands.strip("{}").split(","):
        ends = [int(n) for n in re.findall(r"r(\d+)", part)]
        count += ends[1] - ends[0] + 1 if len(ends) == 2 else 1
    return count


def read_usage(folder: Path) -> dict[str, int]:
    """Frames by function name from every .su file below folder; the largest of those of one name."""
    frames: dict[str, int] = {}
    for path in folder.rglob("*.su"):
        for line in path.read_text(encoding="utf-8").splitlines():
            where, size, kind = line.split("\t")
            if kind != "static" and "bounded" not in kind:
                raise Unknown(f"{where}: the frame's size is {kind}")
            name = CLONE.sub("", where.rsplit(":", 1)[1])
            frames[name] = max(frames.get(name, 0), int(size))
    return frames


@dataclass
class Program:
    functions: dict[str, Function]
    frames: Mapping[str, int]
    pointers: Mapping[str, tuple[str, ...]]  # what a function calls through pointers

    def named(self, name: str) -> str:
        """The function as it is called in the image, where the compiler may have made a variant of it."""
        found = [key for key in self.functions if CLONE.sub("", key) == name]
        if len(found) != 1:
            raise Unknown(f"{len(found)} functions in the image are called {name}; there must be one")
        return found[0]

    def frame(self, name: str) -> int:
        return self.frames.get(CLONE.sub("", name), self.functions[name].pushed)

    def callees(self, name: str) -> set[str]:
        function = self.functions[name]
        base = CLONE.sub("", name)
        if function.indirect and base not in self.pointers:
            raise Unknown(f"{name} calls through a pointer; tools/image/check.py must list what it may call")
        return function.calls | set(self.pointers.get(base, ()))

    def deepest(self, name: str, above: tuple[str, ...] = ()) -> tuple[int, tuple[str, ...]]:
        """Bytes, and the chain of calls that needs them."""
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
    """A Program from an ELF file and the .su files of its build."""
    done = subprocess.run([objdump, "-d", str(elf)], capture_output=True, text=True, check=True)
    return Program(read_functions(done.stdout.splitlines()), read_usage(usage), pointers)
