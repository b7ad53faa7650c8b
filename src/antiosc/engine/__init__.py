"""The C library of the march from Python: systems, contact laws, time steps and error control."""
