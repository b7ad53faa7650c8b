"""Reduced models of a body at its sites: free modes, anti-oscillators, dynamic stiffness."""
