"""What a simulation returns: forces, motions, energies, and how it ended."""
