"""One strike to a tolerance, advice, and many strikes over a surface: maps."""
