"""Structures: K and M with supports, attachments and rigid-body modes, of a mesh or given."""
