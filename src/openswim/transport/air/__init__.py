"""The clear atmosphere in spherical shells: its slant depths to the sun and its scattered light."""
