"""From solved light to what an eye sees."""
