"""What tools/bench/front puts side by side: each kernel's errors, its cycles, and the sensor's own step."""
