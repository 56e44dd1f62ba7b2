"""What the thesis states held against cubes, by one rule."""
