"""The reference: paths of photons from the eye backwards."""
