"""Models with a form of their own: RAMS, LAPS, COSP inputs, IFS columns, text files of LES."""
