"""Answers for people and programs: tables, words, JSON, and files written completely or not at all.

`nearness` reports how close drones come if no rule limits it.
"""
