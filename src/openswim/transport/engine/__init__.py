"""What kernels share: packs of wavelengths, threads, scratch, ordinates, and the cache of what is compiled."""
