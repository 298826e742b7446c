"""Studies of many ducts whose inputs are not known well, and fits to measured curves.

plan -> sampling -> ensemble -> results -> report; curves -> fit. Nothing here knows the trainer.
"""
