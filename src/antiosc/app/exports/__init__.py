"""Impacts and models for other programs: FMUs, one C file, MuJoCo, Modelica."""
