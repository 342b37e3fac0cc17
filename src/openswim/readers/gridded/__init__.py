"""CF-like files of many models: names, axes, columns and levels found by what the files say of themselves."""
