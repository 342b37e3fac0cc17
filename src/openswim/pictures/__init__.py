"""What a camera sees of a lit scene: where it stands, its eye in every light, and its image as data."""
