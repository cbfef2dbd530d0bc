"""Maps: rasters of heights, and ground plans and buildings in files of polygons."""
