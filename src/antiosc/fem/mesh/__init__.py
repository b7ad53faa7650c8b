"""Meshes with named groups: cells, faces, closest points, and checks of meshes."""
