"""Element families: the weak forms of solids, beams, shells and laminates."""
