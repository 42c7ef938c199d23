"""A run: its folder, ledger, scheduler, workers, shards, farms and statistics."""
