"""Sites, the points and directions of impact, as load vectors b."""
