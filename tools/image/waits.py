"""Finds unbounded waits in a port's C source.

Every loop on a register goes through the helpers of cortex_m.h and of the port's wait.h. Elsewhere any `while` is
refused. So is a `for` with a condition that reads a register or is missing; the only exception is the
endless loop after a requested reset.
"""

from __future__ import annotations

import re
from pathlib import Path

HELPERS = "wait.h"
CURE = "use wait_for of cortex_m.h, or count turns in a for and break out of it by an if on the register"
SHARED = "cortex_m.h"
REGISTERS = "*_regs.h"
AFTER_RESET = re.compile(r"void (system|early)_reset\(void\)")
COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.S)
LOOP = re.compile(r"\b(while|for)\b\s*\(")
DEFINED = re.compile(r"^#define (\w+)(?:\(\w+\))?\s+(?:REG32|\(\*)", re.M)


def unbounded(port: Path, *register_folders: Path) -> list[str]:
    """One line for each loop that is not allowed."""
    headers = [path for folder in register_folders or (port,) for path in folder.glob(REGISTERS)]
    registers = {name for path in headers for name in DEFINED.findall(path.read_text(encoding="utf-8"))}
    wrong = []
    for path in sorted(port.rglob("*.[ch]")):
        if path.name not in (HELPERS, SHARED):
            text = COMMENT.sub(lambda m: re.sub(r"[^\n]", " ", m.group()), path.read_text(encoding="utf-8"))
            wrong += [f"{path.relative_to(port)}:{line}: {why}" for line, why in loops(text, registers)]
    return wrong


def loops(text: str, registers: set[str]) -> list[tuple[int, str]]:
    found = []
    for match in LOOP.finditer(text):
        line = text.count("\n", 0, match.start()) + 1
        if match.group(1) != "for":
            found.append((line, f"while loop: {CURE}"))
            continue
        condition = parenthesis(text, match.end() - 1).split(";")[1]
        if not condition.strip() and not AFTER_RESET.search(text[: match.start()].rsplit("\n}", 1)[-1]):
            found.append((line, "endless for loop"))
        elif used := registers & set(re.findall(r"\w+", condition)):
            found.append((line, f"for loop waits for {min(used)}: {CURE}"))
    return found


def parenthesis(text: str, start: int) -> str:
    depth = 0
    for at in range(start, len(text)):
        depth += (text[at] == "(") - (text[at] == ")")
        if depth == 0:
            return text[start + 1 : at]
    return text[start + 1 :]
