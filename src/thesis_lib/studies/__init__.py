"""A typed request and its labelled cube."""
