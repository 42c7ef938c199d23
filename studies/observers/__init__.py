"""Validation of the metric on published experiments with human observers."""
