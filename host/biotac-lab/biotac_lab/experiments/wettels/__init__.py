"""What Wettels and Loeb 2011 did, part by part; `wettels2011` runs them all."""
