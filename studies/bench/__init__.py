"""The bench: our methods against their rivals on one path tracer, quality over CPU time."""
