"""The sun's beam through the grid, and within its cells."""
