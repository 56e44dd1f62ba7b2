"""Pieces of pages: texts, tables and figures that pages include, from cubes and facts."""
