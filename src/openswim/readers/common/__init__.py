"""What readers share: files opened, checked and dated, units, what a reader is."""
