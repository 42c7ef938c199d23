"""Studies: how well the parts of this package do what they claim; nothing else depends on them."""
