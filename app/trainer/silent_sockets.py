"""Connections that say nothing: a page speaks at once, so what stays silent is no page."""

import asyncio

import viser

__all__ = ["close_silent"]


def close_silent(server: viser.ViserServer, suspects: set[int]) -> set[int]:
    """Close the connections that were silent the last time and still are.

    viser counts a client from its first message on. Until then it has no session, but its socket
    and three tasks of the server.

    Parameters
    ----------
    server
        The server.
    suspects
        Numbers of the connections that were silent the last time.

    Returns
    -------
    set[int]
        Those that are silent now, to be given the next time.
    """
    # viser has no public list of the connections that are no clients yet.
    websockets = server._websock_server  # pyright: ignore[reportPrivateUsage]
    loop = server.get_event_loop()
    connections = dict(websockets._live_connections)  # pyright: ignore[reportPrivateUsage]
    silent = connections.keys() - server.get_clients().keys()
    for number in silent & suspects:
        asyncio.run_coroutine_threadsafe(connections[number].close(), loop)
    return silent - suspects
