"""The server: it serves pages, advances their sessions and compiles kernels ahead of use."""
