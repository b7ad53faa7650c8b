"""One strike to a tolerance, advice on models, and maps of many strikes over a surface."""
