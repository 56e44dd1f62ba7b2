"""Pages that need no server: HTML fragments, viewer, tables, self-contained pages."""
