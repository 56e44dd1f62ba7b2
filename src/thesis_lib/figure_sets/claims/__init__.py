"""The ledger of what the thesis states, and its own runs."""
