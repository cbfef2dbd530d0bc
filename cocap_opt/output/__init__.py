"""Answers as people and programs get them: printed tables, JSON, and files written whole."""
