"""What particles of one size or shape show: coronas and glories, halos."""
