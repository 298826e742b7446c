"""Numbers of slices as they are said."""

from collections.abc import Sequence


def slice_ranges(indices: Sequence[int]) -> str:
    """Return numbers of slices with neighbours put together.

    Parameters
    ----------
    indices
        Numbers of slices, ascending.

    Returns
    -------
    str
        The numbers, as "3, 5-8".

    Examples
    --------
    >>> slice_ranges([3, 5, 6, 7, 8])
    '3, 5-8'
    """
    runs: list[list[int]] = []
    for index in indices:
        if runs and index == runs[-1][-1] + 1:
            runs[-1].append(index)
        else:
            runs.append([index])
    return ", ".join(str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs)
