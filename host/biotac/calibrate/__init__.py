"""From counts to newtons: wrench and pressure calibrations, and the reference sensors they are made with."""
