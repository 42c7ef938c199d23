"""Tables, plots and pages of a run, made from its files without rendering."""
