"""Dissections as environments of Gymnasium, for policies; no viewer in it (docs/rl.md).

Importing this makes `ID` known to Gymnasium, which has looked for environments of installed
packages no more since its version 1.0.
"""

import gymnasium

ID = "bluntdissect/Dissection-v0"

__all__ = ["ID"]

gymnasium.register(  # pyright: ignore[reportUnknownMemberType]
    ID,
    entry_point="app.rl.environment:DissectionEnv",
    vector_entry_point="app.rl.environment:DissectionVectorEnv",
)
