"""Recipes: scenes made of maps, meshes, tracks and drones."""
