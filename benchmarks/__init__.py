"""Benchmarks: what things cost, measured on the machine they run on. `make bench` runs them."""
