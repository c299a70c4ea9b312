"""Every finding: its severity, meaning and cure, read from host/docs/reference/doctor.md, which is installed, too."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

from ..wire.native import BUILT

_ENTRY = re.compile(r"^## (\w+)\n\n\*(error|warning)\.\* (.+)\n\n\*\*Cure:\*\* (.+)$", re.MULTILINE)


@dataclass(frozen=True)
class Entry:
    severity: Literal["error", "warning"]  # data must not be trusted; or something else is wrong
    meaning: str
    cure: str


@dataclass(frozen=True)
class Finding:
    """One finding: ``seen`` is the observation here; the catalogue has the other texts."""

    code: str
    seen: str

    @property
    def entry(self) -> Entry:
        return CATALOGUE[self.code]


#: By code, in the page's order.
CATALOGUE: dict[str, Entry] = {
    code: Entry(severity, meaning, cure)
    for code, severity, meaning, cure in _ENTRY.findall((BUILT / "doctor.md").read_text(encoding="utf-8"))
}
