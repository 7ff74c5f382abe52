"""`drpt view`."""

from __future__ import annotations

import argparse
import os
import sys
import threading
import webbrowser
from contextlib import closing, suppress
from importlib import import_module
from typing import TYPE_CHECKING

from drpt.cli.interrupts import interrupts_noted
from drpt.cli.parser import add_scene, add_size, integer, thread_count
from drpt.cli.status import STATUSES, TERMINATED, bad_input
from drpt.distribution import EXTRAS, NAME, install_command
from drpt.kernel import backend

if TYPE_CHECKING:
    import socket

    from drpt.cli.interrupts import Request
    from drpt.cli.parser import Commands
    from drpt.view.worker import Worker

PACKAGES = EXTRAS["view"]
"""Packages that the extra installs; their imports have the same names."""
DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
"""Variables of which one is set where a Linux has a browser to open."""


def add(commands: Commands) -> None:
    """Declare the flags."""
    parser = commands.add_parser(
        "view",
        help="look at a scene in the browser, and change it",
        description=f"""Show a scene in the browser while it is rendered: compare modes, move the
light, see the paths through a pixel. It needs the extra {NAME}[view];
without that, this command says how to install it.""",
        epilog=f"""examples:
  drpt view cornell-box
  drpt view my.toml --width 512 --height 512 --threads 4
  drpt view veach --host 0.0.0.0 --port 8000 --no-browser

The URL is printed; Ctrl-C ends the view. Other machines get in only where --host says so, and
only with the token in the URL (put this machine's name in the place of 127.0.0.1). Nothing is
encrypted: across untrusted networks, tunnel it by ssh -L 8765:localhost:8765 MACHINE instead.

exit status: {STATUSES}, {TERMINATED} after SIGTERM""",
    )
    add_scene(parser)
    add_size(parser.add_argument_group("picture"))
    _add_server(parser.add_argument_group("server"))
    machine = parser.add_argument_group("run")
    machine.add_argument(
        "--threads", metavar="N", type=thread_count, help="CPU threads (default: one per core)"
    )
    parser.set_defaults(parser=parser, run=run)


def _add_server(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--host",
        metavar="H",
        default="127.0.0.1",
        help="the address to listen on (default: %(default)s, this machine alone); "
        "0.0.0.0 or :: takes all",
    )
    group.add_argument(
        "--port",
        metavar="N",
        type=_port,
        help="the port to listen on, 0 for any (default: the first free one from 8765 on)",
    )
    group.add_argument(
        "--no-browser",
        dest="browser",
        action="store_false",
        help="do not open the URL in a browser",
    )


def _port(text: str) -> int:
    port = integer(text)
    if not 0 <= port < 2**16:
        allowed = f"a whole number from 0 to {2**16 - 1}"
        raise argparse.ArgumentTypeError(f"{port} is not allowed; it must be {allowed}")
    return port


def run(args: argparse.Namespace) -> int:
    """Show the scene until a signal asks for an end."""
    with bad_input(args.parser):
        _check_packages()
        from drpt.view.serving import listen
        from drpt.view.worker import Worker

        worker = Worker(args.scene, width=args.width, height=args.height)
        listener = listen(args.host, args.port)
    with closing(listener):
        backend.load()
        if args.threads is not None:
            backend.set_thread_count(args.threads)
        with interrupts_noted(leave=os._exit) as request:  # Python would not wait for the renderer
            _serve(worker, listener, request, args)
    return request.status


def _check_packages() -> None:
    for name in PACKAGES:
        try:
            import_module(name)
        except ImportError as error:
            install = f"{install_command('view')} installs it"
            raise ImportError(f"view: it needs {name} ({error}); {install}") from error


def _serve(
    worker: Worker, listener: socket.socket, request: Request, args: argparse.Namespace
) -> None:
    from drpt.view.security import Guard
    from drpt.view.server import make_app
    from drpt.view.serving import Server, url_of

    guard = Guard(args.host, listener.getsockname()[0])
    server = Server(make_app(worker, guard), lambda: request.signal is not None)
    url = url_of(listener, args.host, guard.token)
    worker.start()
    try:
        print(url, flush=True)
        if args.browser and _has_browser():
            threading.Thread(target=_open_browser, args=[url], daemon=True).start()
        server.run(sockets=[listener])
    finally:
        worker.stop()


def _has_browser() -> bool:
    return sys.platform != "linux" or any(os.environ.get(name) for name in DISPLAYS)


def _open_browser(url: str) -> None:
    with suppress(OSError, webbrowser.Error):
        webbrowser.open(url)
