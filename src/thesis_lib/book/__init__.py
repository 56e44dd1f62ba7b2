"""What is made of many cubes, or of the whole book."""
