"""The bench: quality over CPU time of enfilade's methods and of baselines, on one path tracer."""
