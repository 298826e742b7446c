"""The package says where its files are."""

import assets


def test_the_paths_exist_and_are_all_that_is_exported() -> None:
    assert set(assets.__all__) == {"BEDS", "BILE_DUCT", "BILE_DUCT_PHANTOM", "PRESETS"}
    assert assets.BILE_DUCT_PHANTOM.is_dir()
    assert assets.BILE_DUCT.is_file()
    assert assets.PRESETS.is_file()
