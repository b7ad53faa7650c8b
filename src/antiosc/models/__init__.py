"""What a body is, seen from its sites: free modes, anti-oscillators, driving-point stiffness."""
