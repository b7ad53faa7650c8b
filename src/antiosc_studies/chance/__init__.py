"""What chance does: results of runs whose inputs are uncertain."""
