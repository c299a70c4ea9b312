"""The work of Wettels and Loeb 2011, part by part; `wettels2011` runs them all."""
