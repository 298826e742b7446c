"""The package says where its files are."""

import assets


def test_the_paths_exist_and_are_all_that_is_exported() -> None:
    paths = {
        *("ANATOMIES", "BEDS", "BILE_DUCT", "BILE_DUCT_PHANTOM"),
        *("EXPERIMENTS", "FREQUENCIES", "PRESETS", "RELAXATIONS"),
        *("RUNS", "SCRIPTS", "TUBE_KINDS", "VALIDATION"),
    }
    assert set(assets.__all__) == paths
    assert all(getattr(assets, name).exists() for name in paths)
    assert assets.BILE_DUCT_PHANTOM.is_dir()
    assert assets.ANATOMIES.is_dir()
