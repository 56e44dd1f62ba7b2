"""Figure set footprint: begun from a template."""
