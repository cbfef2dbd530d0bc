"""Certificates: the numbers that prove a bound, and the sweep that checks them."""
