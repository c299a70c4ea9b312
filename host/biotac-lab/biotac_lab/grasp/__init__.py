"""Two opposed fingers grip, lift and let go of things: a controller's losses with the forces that it is given."""
