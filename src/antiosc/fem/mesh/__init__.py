"""Meshes with named groups: cells, faces, closest points, and what must be true of them."""
