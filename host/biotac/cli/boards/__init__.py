"""Verbs about boards: which are there, what is wrong with them, what they store."""
