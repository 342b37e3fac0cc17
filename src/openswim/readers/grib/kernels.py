"""The kernels that unpack GRIB, kept by Numba as those of transport are."""

# ruff: noqa: E402
from openswim.system.compiling import heal, provide_cache

provide_cache()  # before any kernel is defined

from openswim.readers.grib import unpack
from openswim.readers.grib.unpack import is_complex, unpacked

heal(vars(unpack).values())

__all__ = ["is_complex", "unpacked"]
