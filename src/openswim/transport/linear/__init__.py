"""The light of `fast` as a linear fixed point, with tangent linear and adjoint by what its nodes are filled with."""
