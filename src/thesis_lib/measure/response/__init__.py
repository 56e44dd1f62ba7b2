"""How much a structure moves for a force that was recorded beside it, frequency by frequency."""
