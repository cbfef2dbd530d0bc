"""The engine: methods run within limits, judged by the referee, verified and explained."""
