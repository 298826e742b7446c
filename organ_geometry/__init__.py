"""Organs from cross-section images: images, edges, curves, sections, organs, skins, meshes."""
