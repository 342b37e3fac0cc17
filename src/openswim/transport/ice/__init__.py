"""Light through crystals of ice that are smooth prisms."""
