"""Tables and plots of a run; they read what a run has written and compute nothing of it."""
