"""Experiments, benchmarks, the demo and the cross-check, which few programs import."""
