"""Calibrations that only a laboratory makes: the normal at the point of contact, and the map of many fingers."""
