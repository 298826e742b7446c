"""Benchmarks: times and sizes measured on the machine they run on. `make bench` runs them."""
