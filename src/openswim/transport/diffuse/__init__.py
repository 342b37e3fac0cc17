"""Light that is scattered many times, by sweeps along discrete ordinates."""
