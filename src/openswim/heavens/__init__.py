"""What stands in the sky besides the sun: which lights are solved for, and what of moon and stars an eye sees."""
