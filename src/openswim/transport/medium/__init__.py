"""A scene's species on the transport grid: levels, columns, and how finely they are divided."""
