"""Two opposed fingers grip, lift and let go of things: what a controller loses with the forces that it is given."""
