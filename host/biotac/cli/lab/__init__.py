"""Verbs of the lab: demo, benchmarks, experiments."""
