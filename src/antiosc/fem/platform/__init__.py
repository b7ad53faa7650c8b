"""The ground under the finite elements: versions of dolfinx, its compiled forms, and MPI ranks."""
