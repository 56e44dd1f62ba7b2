"""The book: its pieces, the steps that build it, its pages, and where they are published."""
