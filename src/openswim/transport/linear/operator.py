"""The linear core: what eyes and pyranometers see of extinction at nodes, with tangent linear and adjoint.

    core = LinearCore(world, scatterers, views, points, tolerance=1e-3)       # frozen; see `plain.plain_core` (tests) and
                                                                              # `Solver("linear").core(scene, ...)`
    images, state = core.forward(extinction, albedo)                           # Images, State
    change = core.tangent(state, d_extinction, d_albedo)                       # Images: J v
    extinction_bar, albedo_bar = core.adjoint(state, residual)                 # J^T r, residual: Images

extinction (w, k, nz, ny, nx), 1/m: of scatterer class k (``core.names``) at the wavelength w (``core.wavelengths_nm``),
at the nodes of ``core.shape`` = (nz, ny, nx); albedo (w, ny, nx) of the Lambertian ground. ``core.extinction`` and
``core.albedo`` are those of the scene that the core was made from. `Images`: radiance, a list of (w, rays), one a view;
ghi (w, points). ``d_albedo`` may be None. A `State` holds what a linearisation needs; it may be kept, several at once.
Everything else is held fixed: see docs/linear.md.
"""
