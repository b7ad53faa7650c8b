"""Drops: free flight with large rotations, impacts on a floor, and the motion until rest."""
