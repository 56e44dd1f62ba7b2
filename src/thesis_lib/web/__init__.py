"""Pieces of pages that need no server: fragments, viewer, tables, pages of their own."""
