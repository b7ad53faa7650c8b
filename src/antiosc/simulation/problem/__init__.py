"""From scenes to what the march integrates: contacts, loads, modes, states."""
