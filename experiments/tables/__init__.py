"""Rows of results, their columns, and the tables and statistics made of them."""
