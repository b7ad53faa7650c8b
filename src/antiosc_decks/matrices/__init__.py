"""Files of matrices of Nastran (OP4, DMIG) and Ansys (Harwell–Boeing)."""
