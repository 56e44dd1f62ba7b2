"""Planning: where cameras should stand, and how many of which kind, before any is bought."""
