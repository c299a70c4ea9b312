"""Proofs about the C that ships, read from the C itself: a small interpreter and the domains it computes in."""

from collections.abc import Callable

Report = Callable[[str], None]  # takes what was proved, with figures, for whoever ran the proofs
