"""What tools/bench/front compares: each kernel's errors, its cycles, and the effect of the sensor's own ADC step."""
