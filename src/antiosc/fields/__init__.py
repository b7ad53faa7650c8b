"""Fields of a history: probes, peaks, margins, reactions, spectra, pictures and files."""
