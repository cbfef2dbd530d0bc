"""Answers as people and programs get them: tables, words, JSON, and files written whole."""
