"""What the backends of a platform file bring together: boards of one name, boards that are absent.

Only simulated backends are asked, for making them opens nothing; which boards a real driver lists
is known on the computer that they are in, when they are opened.
"""

from collections.abc import Iterator

from cosmic.app.configuration.platform_file import PlatformFile
from cosmic.daqco.core.settings import DaqcoSettings
from cosmic.daqco.hw.factory import make_library
from cosmic.daqco.hw.interface import BoardInfo
from cosmic.frame.config import not_there
from cosmic.frame.errors import CosmicError
from cosmic.frame.plugins import Kind, has_twin, is_simulated


def twin_mistakes(file: PlatformFile) -> Iterator[str]:
    """Yield a line where more than one controller would move the twin."""
    movers = [each for each in file.mico.backends if has_twin(Kind.CONTROLLER, each)]
    if len(movers) > 1:
        yield f"mico: {' and '.join(map(repr, movers))} would both move the twin: leave one"


def board_mistakes(file: PlatformFile) -> list[str]:
    """Return a line for each board that is there twice, and for each name of one that is not."""
    settings = file.daqco
    if settings is None:
        return []
    boards: dict[str, BoardInfo] = {}
    lines: list[str] = []
    for each in settings.drivers:
        if not is_simulated(Kind.BOARD, each.backend):
            continue
        try:
            listed = make_library(each.backend, options=each.options).list_boards()
        except CosmicError as exc:
            return [f"daqco: {exc}"]
        lines += [
            f"daqco: two boards are named {info.name!r}, and one of them is of driver "
            f"{each.backend!r}: give the boards of one driver another name"
            for info in listed
            if info.name in boards
        ]
        boards |= {info.name: info for info in listed}
    if all(is_simulated(Kind.BOARD, each.backend) for each in settings.drivers):
        lines += _absent(settings, boards)
    return lines


def _absent(settings: DaqcoSettings, boards: dict[str, BoardInfo]) -> Iterator[str]:
    """Yield a line for each board and input that is named and not there."""
    named = [(f"channel {each.name!r}", each.board) for each in settings.channel]
    named += [(f"output {each.name!r}", each.board) for each in settings.output]
    if settings.camera_trigger is not None:
        named.append(("camera_trigger", settings.camera_trigger.board))
    for what, board in named:
        if board not in boards:
            yield f"daqco: {what}: {not_there('board', board, boards)}"
    for each in settings.channel:
        if each.board in boards and each.input not in boards[each.board].inputs:
            inputs = boards[each.board].inputs
            yield (
                f"daqco: channel {each.name!r}: {each.board} has no input {each.input!r}; it has "
                f"{inputs[0]} to {inputs[-1]}"
            )
