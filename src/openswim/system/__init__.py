"""What the machine gives and takes: memory, files while they are made, signals, and compiled kernels on disk."""
