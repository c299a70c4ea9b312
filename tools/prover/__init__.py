"""Proofs about the C that ships, read from the C itself: a small interpreter and the domains it computes in."""
