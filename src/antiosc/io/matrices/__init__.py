"""Files of stiffness and mass matrices that other programs write or read."""
