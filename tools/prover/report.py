"""What was proved, with its figures, for whoever ran the proofs."""

from __future__ import annotations

from collections.abc import Callable

Report = Callable[[str], None]
