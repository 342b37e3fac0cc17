"""How light travels: a sweep through the grid along one direction, and a march along an eye ray."""
