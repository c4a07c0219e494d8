"""Drawing of scans: triangles with textures, and the file that has them."""
