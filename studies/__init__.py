"""Studies of enfilade: benchmarks, validation and example scenes. The package does not depend on them."""
