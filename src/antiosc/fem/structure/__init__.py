"""Structures: K and M with supports, attachments and rigid-body modes, from a mesh or given."""
