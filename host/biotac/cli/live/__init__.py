"""Verbs about streams, live or simulated."""
