"""An application at another station, in the place of one that runs here."""

from typing import Final, Generic, TypeVar

from PySide6.QtCore import QObject
from typing_extensions import override

from cosmic.frame.application import CosmicApplicationBase, GuiFactory
from cosmic.frame.clock import WALL
from cosmic.frame.declaration import Declared
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.link import ApplicationLink
from cosmic.frame.network.proxy import proxy_of
from cosmic.frame.network.transport import Transport
from cosmic.frame.operation import Task
from cosmic.frame.task_application import TaskApplication

D = TypeVar("D", bound=Declared)

FIRST_STATE_S: Final = 5.0
FIRST_DATA_S: Final = 1.0
_LOOK_S: Final = 0.005


class RemoteApplication(TaskApplication, Generic[D]):
    """Stands where an application does whose hardware is elsewhere; any thread.

    Parameters
    ----------
    title : str
        What the operator reads.
    kind : type
        What the application declares.
    transport : Transport
        To the station; whoever made it closes it, after `shut_down`.
    name : str
        Under which the application is hosted there.

    Attributes
    ----------
    api : object
        What is declared, used as if it were here.
    """

    def __init__(
        self,
        title: str,
        kind: type[D],
        transport: Transport,
        policy: FailurePolicy,
        *,
        name: str,
        gui_factory: GuiFactory | None = None,
        parent: QObject | None = None,
    ) -> None:
        super().__init__(title, policy, gui_factory, parent)
        self._link = ApplicationLink(kind, transport, name, policy)
        self.api = proxy_of(kind, self._link)
        self.api.on_change(lambda: self.status_changed.emit())

    @property
    def transport(self) -> Transport:
        """The way to the station."""
        return self._link.transport

    @override
    def initialize(self) -> None:
        """Begin to use the station; stays open with `api.away` set where it cannot be reached.

        Returns when it is known how things stand there, and there are first data.
        """
        self._begin()
        if not self._link.wait_until_known(FIRST_STATE_S):
            return
        until_s = WALL.now_s() + FIRST_DATA_S
        while not self._link.ready and WALL.now_s() < until_s:
            WALL.sleep(_LOOK_S)

    def initialize_later(self) -> Task:
        """Do what `initialize` does without waiting."""
        self._begin()

        def job(task: Task) -> None:
            self._link.wait_until_known(FIRST_STATE_S)
            task.finish()

        return self.begin(f"Connecting to {self.title}", job)

    def _begin(self) -> None:
        self.start()
        self._link.open()

    @override
    def request_end(self) -> None:
        super().request_end()
        self._link.let_go()

    @override
    def shut_down(self) -> None:
        """Use the station no more; there everything goes on. Any state."""
        self.request_end()
        self._link.close()
        self.join()


def remote_api(application: CosmicApplicationBase, kind: type[D]) -> D:
    """Return what an application at another station offers.

    Raises
    ------
    TypeError
        It is none, or it offers something else.
    """
    if isinstance(application, RemoteApplication) and isinstance(application.api, kind):
        return application.api
    raise TypeError(f"{application!r} does not offer {kind.__name__}")
