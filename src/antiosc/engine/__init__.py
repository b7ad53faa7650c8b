"""Time integration (the march) by the C library: systems, contact laws, steps, error control."""
