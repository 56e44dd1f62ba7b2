"""The cameras of chapter 2."""
