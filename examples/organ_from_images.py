"""From section images to a file of a few bytes, and a closed mesh that another tool reads."""

from pathlib import Path

from assets import BILE_DUCT_PHANTOM
from organ_geometry import Promise, build_organ, read_image_stack, read_organ, write_organ
from organ_geometry.mesh import Surface, mesh_content, organ_skin

stack = read_image_stack(BILE_DUCT_PHANTOM)
built = build_organ(stack, promise=Promise(tolerance_px=0.7))
write_organ(built.organ, Path("duct.organ"))
print(f"sections {built.sections_in} in, {built.sections_kept} kept")
print(f"error    {built.rms_error_mm:.3f} mm RMS")
print(f"file     {Path('duct.organ').stat().st_size} bytes")

skin = organ_skin(read_organ(Path("duct.organ")), edge_length=1.0)
surface = Surface("duct", skin, skin.vertices.astype("float32"))
Path("duct.stl").write_bytes(mesh_content([surface], ".stl"))
