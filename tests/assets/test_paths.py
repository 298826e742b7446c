"""The package says where its files are."""

import assets
from organ_geometry.images.stack_reader import read_image_stack
from organ_geometry.organ_builder import build_organ
from organ_geometry.organ_file import read_organ


def test_the_paths_exist_and_are_all_that_is_exported() -> None:
    assert set(assets.__all__) == {"BEDS", "BILE_DUCT", "BILE_DUCT_PHANTOM", "PRESETS"}
    assert assets.BILE_DUCT_PHANTOM.is_dir()
    assert assets.BILE_DUCT.is_file()
    assert assets.PRESETS.is_file()


def test_the_shipped_organ_is_what_its_images_give_without_a_warning() -> None:
    built = build_organ(read_image_stack(assets.BILE_DUCT_PHANTOM))
    shipped = read_organ(assets.BILE_DUCT)
    assert built.warnings == ()
    assert shipped.encoded == built.organ.encoded
    assert shipped.name == built.organ.name
