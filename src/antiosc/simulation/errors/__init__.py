"""What an impact may be wrong by, cause by cause."""
