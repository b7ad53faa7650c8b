"""Sites: where and along which direction a structure is struck, as load vectors b."""
