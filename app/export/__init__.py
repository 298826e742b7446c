"""What other people's tools get: rigged and animated models, series, tables, coloured meshes."""
