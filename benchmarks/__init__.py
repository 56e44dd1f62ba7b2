"""Speed of the library, beside the direct way of writing the same; ``python -m benchmarks``."""
