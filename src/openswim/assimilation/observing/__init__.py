"""The observation operator: from a state of clouds and ground to what is measured, with tangent linear and adjoint."""
