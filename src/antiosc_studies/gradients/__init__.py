"""How a result changes with everything that an impact is made of."""
