"""The metric against people: published measurements, and what the metric says of the same stimuli."""
