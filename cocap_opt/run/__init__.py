"""The engine: runs methods within limits; the referee evaluates, verifies and explains their
results.
"""
