"""Runs a window from its start to its exit code."""

import logging
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from PySide6.QtCore import QCoreApplication, QObject, QSettings, QStandardPaths, Qt, QTimer
from PySide6.QtWidgets import QApplication

from cosmic.app.audit import PlatformAudit, audit_file
from cosmic.app.configuration.check import key_mistakes
from cosmic.app.configuration.gateways import doors
from cosmic.app.configuration.network import serving
from cosmic.app.configuration.platform_file import KNOWN_APPLICATIONS
from cosmic.app.platform import Platform, Uses, build_platform
from cosmic.app.stations.address import StationAddress
from cosmic.app.stations.host import StationHost
from cosmic.app.windows.operator_window import OperatorWindow
from cosmic.daqco.gui.main_widget import make_daqco_gui
from cosmic.frame.errors import ConfigError
from cosmic.frame.gui.palette import ThemeName
from cosmic.frame.hooks import install_hooks
from cosmic.frame.log import RingBufferHandler, set_up_logging
from cosmic.frame.platform_services import ending_signals
from cosmic.frame.threads import declare_gui_thread
from cosmic.mico.gui.mico_widget import make_mico_gui
from cosmic.vico.gui.vico_gui import make_vico_gui

logger = logging.getLogger(__name__)

_SIGNAL_POLL_MS: Final = 250


@dataclass(frozen=True)
class WindowOptions:
    """What the command line says about a window.

    Attributes
    ----------
    only : str
        The one application of a stand-alone window; empty for all of the platform file.
    offscreen_s : float or None
        Show nothing and close after so many seconds.
    screenshot : Path or None
        Where to save an image of the window before it closes.
    sample : str or None
        What lies on the simulated plate, as twin.toml names it.
    truth : Path or None
        Where to write what truly happens on the simulated platform.
    world : str or None
        Which simulated world it is; None: as twin.toml has it.
    size : tuple of int or None
        Width and height of the window; None leaves it as it was.
    serve, listen, name, certificates
        Whether the window serves what it hosts to others, and in place of what the platform file
        says of that.
    stations : tuple of StationAddress
        Others, whose applications it shows.
    """

    config: Path | None = None
    only: str = ""
    rate: float = 1.0
    cold: bool = False
    sample: str | None = None
    truth: Path | None = None
    world: str | None = None
    offscreen_s: float | None = None
    screenshot: Path | None = None
    size: tuple[int, int] | None = None
    theme: ThemeName | None = None
    serve: bool = False
    listen: str | None = None
    name: str | None = None
    certificates: Path | None = None
    stations: tuple[StationAddress, ...] = ()


def run_window(options: WindowOptions) -> int:
    """Run a window until it is closed and return the exit code.

    Raises
    ------
    ConfigError
        The configuration is wrong; nothing was opened.
    NotConnectedError
        The vendor library is not there.
    """
    if options.offscreen_s is not None:
        os.environ["QT_QPA_PLATFORM"] = "offscreen"  # Qt reads nothing else
        logging.getLogger("cosmic.qt").addFilter(_says_something)
    app = _application()  # stays until all else is gone
    with ExitStack() as at_end:
        settings = at_end.enter_context(_settings(offscreen=options.offscreen_s is not None))
        ring = RingBufferHandler()
        at_end.callback(_log_to(ring))
        platform = _build(options)  # before this is the thread of a window, for it may wait
        at_end.callback(platform.shut_down)
        audit = None
        if options.offscreen_s is None:
            audit = at_end.enter_context(PlatformAudit(platform, audit_file()))
        host = _host(options, platform, audit)
        if host is not None:
            at_end.callback(host.close)
        at_end.callback(declare_gui_thread())
        at_end.callback(install_hooks(platform.policy))
        window = OperatorWindow(platform, settings, ring, console=not options.only, host=host)
        at_end.callback(window.deleteLater)
        at_end.enter_context(_closed_by_signals(window.close_now))
        return _run(app, window, options)


def _says_something(record: logging.LogRecord) -> bool:
    """Tell whether a message of Qt is more than that the offscreen platform is no desktop."""
    return not record.getMessage().startswith("This plugin does not support ")


def _log_to(ring: RingBufferHandler) -> Callable[[], None]:
    """Set the log up; a folder that cannot be written to costs the file, not the start."""
    try:
        return set_up_logging(ring, file=log_file())
    except OSError as exc:
        undo = set_up_logging(ring)
        logger.warning("%s: cannot be written; the log is in the window only: %s", log_file(), exc)
        return undo


def log_file() -> Path:
    """Return where the log is kept on this computer."""
    folder = QStandardPaths.writableLocation(QStandardPaths.StandardLocation.AppLocalDataLocation)
    return Path(folder) / "cosmic.log"


def _application() -> QApplication:
    QCoreApplication.setOrganizationName("CoSMic")
    QCoreApplication.setApplicationName("CoSMic")
    # The stop key is not seen in a dialog that the desktop makes.
    QCoreApplication.setAttribute(Qt.ApplicationAttribute.AA_DontUseNativeDialogs)
    existing = QApplication.instance()
    return existing if isinstance(existing, QApplication) else QApplication(sys.argv[:1])


@contextmanager
def _settings(*, offscreen: bool) -> Iterator[QSettings]:
    """Give the operator's settings; an image neither sees nor changes them."""
    if not offscreen:
        yield QSettings(QSettings.Format.IniFormat, QSettings.Scope.UserScope, "CoSMic", "CoSMic")
        return
    with tempfile.TemporaryDirectory() as folder:
        yield QSettings(str(Path(folder) / "window.ini"), QSettings.Format.IniFormat)


def _build(options: WindowOptions) -> Platform:
    only = (options.only,) if options.only else KNOWN_APPLICATIONS
    platform = build_platform(
        options.config,
        applications=only,
        rate=options.rate,
        cold=options.cold,
        sample=options.sample,
        truth=options.truth,
        world=options.world,
        uses=Uses(options.stations, "window", options.certificates, every=not options.only),
        mico_gui=make_mico_gui,
        daqco_gui=make_daqco_gui,
        vico_gui=make_vico_gui,
    )
    mistakes = key_mistakes(platform.file, platform.path)
    if mistakes:
        raise ConfigError("\n".join(mistakes))
    return platform


def _host(
    options: WindowOptions, platform: Platform, audit: PlatformAudit | None
) -> StationHost | None:
    """Return what serves the platform to others, if it is to be served."""
    network = platform.file.network
    if not (options.serve or network.serve):
        if options.certificates is not None and not options.stations:
            raise ConfigError(
                f"--certificates {options.certificates}: proves who this window is to those that "
                "it serves, or that --connect names; add --serve or --connect, or leave it out"
            )
        return None
    how = serving(
        network,
        platform.file.platform.name,
        platform.path.parent,
        listen=options.listen,
        name=options.name,
        certificates=options.certificates,
    )
    return StationHost(platform, how, doors(network.http, network.epics), audit)


@contextmanager
def _closed_by_signals(close: Callable[[], object]) -> Iterator[None]:
    """Close the window in order when the terminal or the system ends the program."""
    wake = QTimer(interval=_SIGNAL_POLL_MS)  # Python sees a signal only when it runs
    wake.timeout.connect(wake.interval)
    wake.start()
    try:
        with ending_signals(lambda _name: close()):
            yield
    finally:
        wake.stop()


class _Photographer(QObject):
    """Takes an image of the window after a while, and closes it."""

    def __init__(self, window: OperatorWindow, file: Path | None) -> None:
        super().__init__(window)
        self._window = window
        self._file = file
        self.failed = False

    def finish(self) -> None:
        """Save the image and close; what cannot be saved ends the program with an error."""
        if self._file is not None and not self._window.grab().save(str(self._file)):
            self.failed = True
        self._window.close_now()


def _run(app: QApplication, window: OperatorWindow, options: WindowOptions) -> int:
    if options.theme is not None:
        window.set_theme(options.theme)
    if options.size is not None:
        window.resize(*options.size)  # the panels share out this height at a first start
    window.show()
    if options.size is not None:
        window.resize(*options.size)  # the show brought back what was remembered
    QTimer.singleShot(0, window.open_hardware)
    photographer = _Photographer(window, options.screenshot)
    if options.offscreen_s is not None:
        QTimer.singleShot(round(1000 * options.offscreen_s), photographer.finish)
    code = app.exec()
    if photographer.failed:
        sys.stderr.write(f"cosmic: {options.screenshot}: the image cannot be saved\n")
        return 1
    return code
