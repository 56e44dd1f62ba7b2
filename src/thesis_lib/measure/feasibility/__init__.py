"""What a planned measurement can find."""
