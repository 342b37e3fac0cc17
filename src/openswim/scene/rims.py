"""How wide the strips are in which nested domains and grids go over into the coarser ones around them."""

CORE_RIM, LEAST_CORE_RIM = 0.08, 2  # share of a grid's columns at each side where the wider is seen; how many at least
BEYOND_CELLS = 30.0  # how far beyond a domain its snow, wind and brightness are felt
_CELLS, _SHARE = 3.0, 0.15


def rim_m(coarser_cell_m: float, width_m: float) -> float:
    """Width of the rim over which a domain `width_m` wide fades into one of coarser cells: three of those, at most 15 %
    of the domain."""
    return min(_CELLS * coarser_cell_m, _SHARE * width_m)
