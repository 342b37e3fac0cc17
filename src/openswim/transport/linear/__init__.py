"""The light of `fast` as a smooth fixed point, with tangent linear and adjoint by what its nodes are filled with."""
