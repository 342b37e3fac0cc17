"""WRF and WRF-Chem."""
