"""All that goes beyond viser's public interface: private names, the page's style, scripts and HTML.

viser has no call for what is here. Each part says what viser lacks, and `test_viser_bridge` has a
test of each that fails with a clear message if another version of viser breaks it.
"""
