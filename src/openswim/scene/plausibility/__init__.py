"""Whether a scene can be."""
