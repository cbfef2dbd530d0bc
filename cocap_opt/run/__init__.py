"""The engine: runs methods within limits, has the referee evaluate their plans, and verifies and
explains their results.
"""
