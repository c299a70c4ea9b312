"""Tests of boards: the emulated Pico's host side, the sensor board's, two wired boards, and soaks."""
