"""The light that reaches the ground, and the shape of the land it falls on."""
