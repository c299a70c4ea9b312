"""Verbs about boards: which are there, their faults, their settings and calibrations."""
