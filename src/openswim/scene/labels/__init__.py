"""What labelled arrays and variables of files say of themselves: their units and their dimensions."""
