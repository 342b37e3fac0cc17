"""Pages of comparisons: pictures, plots, tables, in one file each."""
