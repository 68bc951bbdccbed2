"""What meshes are asked; Warp as a geometry library lives here."""
