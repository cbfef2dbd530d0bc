"""Answers as people and programs get them: tables, words, JSON, and files written whole.

`nearness` says how near drones come where no rule asks for a distance.
"""
