"""`motiondeck fleet`: what a show on several machines needs before it can begin."""

from pathlib import Path
from typing import Annotated

import typer
from typer import Argument

app = typer.Typer(help="Prepare a show on several machines.", no_args_is_help=True)


@app.command()
def certificates(
    folder: Annotated[Path, Argument(metavar="FOLDER", help="Where to put them; its name is that of the show.")],
    members: Annotated[
        list[str], Argument(metavar="NAME=ADDRESS...", help="The conductor and every deck, such as left=192.168.1.21.")
    ],
) -> None:
    """Make the certificates of the members of a show.

    With them machines trust each other. Copy each member's folder to its machine. FOLDER/authority.key can make more
    members: keep it to yourself. Called again, members are added and all certificates renewed.

    [bold]Example[/]

      motiondeck fleet certificates gala conductor=192.168.1.20 left=192.168.1.21 right=192.168.1.22:7450
    """
    from motiondeck_base.errors import MotiondeckError

    try:
        from motiondeck.shows.certificates import YEARS, make_certificates
    except ImportError:
        raise MotiondeckError("certificates need cryptography: pip install 'motiondeck[fleet]'") from None
    addresses: dict[str, str] = {}
    for member in members:
        name, equals, address = member.partition("=")
        if not equals or name in addresses:
            raise MotiondeckError(f"'{member}': give each member once as NAME=ADDRESS, such as left=192.168.1.21")
        addresses[name] = address
    made = make_certificates(folder, folder.resolve().name, addresses)
    for path in made:
        print(path)
    print(f"Valid for {YEARS} years. Next: motiondeck play --show {made[-1]}")
