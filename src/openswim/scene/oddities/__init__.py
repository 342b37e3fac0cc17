"""What may be, but is odd enough to be told."""
