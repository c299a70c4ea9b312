"""Experiments, benchmarks, the demo and the cross-check: what few programs import."""
