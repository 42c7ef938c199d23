"""Studies of enfilade on its public functions; the product does not depend on them."""
