"""Verbs of the laboratory: demo, benchmarks, experiments."""
