"""Drops: free flight with large rotations, impacts on a floor, and what comes after."""
