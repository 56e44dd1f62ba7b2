"""The ledger of the thesis's claims, and its own runs."""
