"""The bench: our methods and their rivals on one tracer, each against a reference, quality over CPU time."""
