"""Along an eye ray: where to look, what a place does to light, and what is seen in the end."""
