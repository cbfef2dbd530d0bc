"""What is solid: height maps, meshes, and the columns of matter above each cell."""
