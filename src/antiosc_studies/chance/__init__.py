"""Studies of runs whose inputs are uncertain."""
