"""Where images of the twin are drawn: in this process, or in one of their own.

Drawing an image takes tens of milliseconds of computing that would keep the interpreter from
whoever commands the platform. A `DrawingProcess` leaves it to the others.
"""

import atexit
import logging
from abc import abstractmethod
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from threading import Condition, Lock
from typing import TYPE_CHECKING, Final, Protocol
from weakref import WeakValueDictionary, finalize

import numpy as np
from typing_extensions import override

from cosmic.frame.arrays import Pixels
from cosmic.frame.helper_process import HelperFaultError, HelperProcess, Reply
from cosmic.twin.optics.settings import OpticsSettings

if TYPE_CHECKING:
    from cosmic.twin.optics.view import Shot, View

logger = logging.getLogger(__name__)


MODULE: Final = "cosmic.twin.optics.drawing_helper"
LIMIT_S: Final = 20.0
"""How long one image may take; a process that needs longer hangs."""
MOST_FAULTS: Final = 3
"""After so many the images are drawn here for good."""
MOST_AHEAD: Final = 8
"""With so many unanswered, further ones are drawn here, and only if somebody wants them.

Some twenty questions fill the pipe; each end would then wait for the other to read.
"""

_sets: Final = count(1)


class Drawing(Protocol):
    """An image that is being drawn; any thread."""

    @property
    @abstractmethod
    def ready(self) -> bool:
        """True when `pixels` need not wait."""

    @abstractmethod
    def pixels(self) -> Pixels:
        """Return the image, shape (height, width), and wait for it."""


class Drawer(Protocol):
    """Draws what the views of one scene see."""

    @abstractmethod
    def begin(self, view: str, shot: "Shot") -> Drawing:
        """Begin to draw what a view sees."""

    @abstractmethod
    def close(self) -> None:
        """Let go of what it draws with; an image that is wanted after all is drawn here."""


def make_views(settings: OpticsSettings, seed: int) -> dict[str, "View"]:
    """Return what draws, by view; it takes OpenCV, which takes time to import."""
    from cosmic.twin.optics.ground import make_dirt
    from cosmic.twin.optics.noise import Noise
    from cosmic.twin.optics.view import View

    noise = Noise(width_px=settings.camera.width_px, height_px=settings.camera.height_px, seed=seed)
    dirt = make_dirt(settings.picture, seed)
    return {name: View(settings, view, dirt, noise) for name, view in settings.views.items()}


class LocalDrawer(Drawer):
    """Draws in the thread that wants the pixels."""

    def __init__(self, settings: OpticsSettings, seed: int) -> None:
        self._settings = settings
        self._seed = seed
        self._lock = Lock()
        self._views: dict[str, View] = {}

    @override
    def begin(self, view: str, shot: "Shot") -> Drawing:
        return _LocalDrawing(self, view, shot)

    def draw(self, view: str, shot: "Shot") -> Pixels:
        """Return the image at once."""
        with self._lock:
            if not self._views:
                self._views = make_views(self._settings, self._seed)
        return self._views[view].draw(shot)

    @override
    def close(self) -> None:
        with self._lock:
            self._views = {}


class _LocalDrawing(Drawing):
    def __init__(self, drawer: LocalDrawer, view: str, shot: "Shot") -> None:
        self._draw: Callable[[], Pixels] = lambda: drawer.draw(view, shot)

    @property
    @override
    def ready(self) -> bool:
        return True

    @override
    def pixels(self) -> Pixels:
        return self._draw()


class _SentDrawing(Drawing):
    """One that the process draws; here, should the process fail."""

    def __init__(self, process: "DrawingProcess", instead: Drawing) -> None:
        self._process = process
        self._instead = instead
        self.number = 0
        self.reply: Reply | None = None

    @property
    @override
    def ready(self) -> bool:
        return self._process.has_reply(self)

    @override
    def pixels(self) -> Pixels:
        reply = self._process.wait_for(self)
        if reply is None or not reply.good or not isinstance(reply.value, np.ndarray):
            if reply is not None:
                logger.warning("an image could not be drawn apart: %s", reply.value)
            return self._instead.pixels()
        return reply.value


class RemoteDrawer(Drawer):
    """Draws in a process of its own, which several scenes share."""

    def __init__(self, process: "DrawingProcess", settings: OpticsSettings, seed: int) -> None:
        self._process = process
        self._settings = settings
        self._seed = seed
        self._local = LocalDrawer(settings, seed)
        self._set = next(_sets)
        self._lock = Lock()
        self._started = 0
        self._lying_key: object = None
        # Where nobody closes it, it goes with the last who knows of it.
        self._end = finalize(self, process.dropped.append, self._set)

    @override
    def begin(self, view: str, shot: "Shot") -> Drawing:
        """Send the exposure; what lies on the plate only when it has changed."""
        here = self._local.begin(view, shot)
        if not self._end.alive or self._process.is_behind():
            return here
        drawing = _SentDrawing(self._process, here)
        with self._lock:
            try:
                started = self._process.start()
                if started != self._started:
                    self._process.put("set", (self._set, self._settings, self._seed))
                    self._started, self._lying_key = started, None
                while self._process.dropped:
                    self._process.put("end", self._process.dropped.popleft())
                subject = shot.subject
                key = subject.lying_key
                lying = None if key == self._lying_key else subject.lying
                self._lying_key = key
                sent = replace(shot, subject=replace(subject, lying=()))
                self._process.put("draw", (self._set, view, sent, lying), drawing)
            except (HelperFaultError, OSError) as exc:
                self._process.fail(exc)
                return here
        return drawing

    @override
    def close(self) -> None:
        self._end()
        self._local.close()


class DrawingProcess:
    """The process that draws; any thread.

    It is started at the first image. One that dies is told in the log and replaced; the images
    that it took along are drawn in this process, and so are all after three such faults.

    Attributes
    ----------
    dropped : deque of int
        Sets of views that nobody needs any more; told to the process at the next image.
    """

    def __init__(self) -> None:
        self.dropped: deque[int] = deque()
        self._state = Condition(Lock())
        self._sending = Lock()
        self._receiving = False
        self._helper: HelperProcess | None = None
        self._starts = 0
        self._faults = 0
        self._ahead: set[int] = set()  # images asked for and not come, wanted or not
        self._wanted: WeakValueDictionary[int, _SentDrawing] = WeakValueDictionary()

    def start(self) -> int:
        """Start the process unless it runs; returns how many times it was started.

        Raises
        ------
        HelperFaultError, OSError
            It cannot be started, or not any more.
        """
        with self._state:
            if self._faults >= MOST_FAULTS:
                raise HelperFaultError("it failed too often")
            if self._helper is None:
                self._helper = HelperProcess(MODULE, stalled_s=round(LIMIT_S), background=True)
                self._starts += 1
            return self._starts

    def is_behind(self) -> bool:
        """Tell whether it has as many images to draw as it may have; does not wait."""
        with self._state:
            if len(self._ahead) >= MOST_AHEAD and not self._receiving:
                self._take(0.0)
            return len(self._ahead) >= MOST_AHEAD

    def put(self, kind: str, payload: object, drawing: _SentDrawing | None = None) -> None:
        """Send a question, and remember who waits for its answer.

        Raises
        ------
        HelperFaultError
            It takes none.
        """
        with self._sending:
            with self._state:
                helper = self._helper
                if helper is None:
                    raise HelperFaultError("it was ended")
                if not self._receiving:
                    self._take(0.0)  # a process that cannot get rid of its answers reads nothing
                number = helper.next_number()
                if drawing is not None:
                    drawing.number = number
                    self._wanted[number] = drawing
                    self._ahead.add(number)
            helper.put(number, kind, payload, LIMIT_S)

    def has_reply(self, drawing: _SentDrawing) -> bool:
        """Tell whether an answer has come, or none will; does not wait."""
        with self._state:
            if drawing.reply is None and not self._receiving and self._awaits(drawing):
                self._take(0.0)
            return drawing.reply is not None or not self._awaits(drawing)

    def wait_for(self, drawing: _SentDrawing) -> Reply | None:
        """Return the answer; None when none will come."""
        with self._state:
            while drawing.reply is None and self._awaits(drawing):
                if self._receiving:
                    self._state.wait(LIMIT_S)
                elif not self._take(LIMIT_S):
                    self._failed("it did not answer in time")
            return drawing.reply

    def fail(self, exc: Exception) -> None:
        """Give the process up after a fault."""
        with self._state:
            if self._helper is not None:
                self._failed(str(exc))

    def end(self) -> None:
        """End it; whoever still waits draws here."""
        with self._state:
            self._ended()

    def _awaits(self, drawing: _SentDrawing) -> bool:
        return self._wanted.get(drawing.number) is drawing

    def _take(self, wait_s: float) -> bool:
        """Receive what has come, with the state given free while it waits; False: nothing."""
        helper = self._helper
        if helper is None:
            return True
        self._receiving = True
        self._state.release()
        replies: list[Reply] = []
        fault = ""
        try:
            while (reply := helper.take(0.0 if replies else wait_s)) is not None:
                replies.append(reply)
        except HelperFaultError as exc:
            fault = str(exc)
        finally:
            self._state.acquire()
            self._receiving = False
        self._ahead.difference_update(reply.number for reply in replies)
        for reply in replies:
            waiting = self._wanted.pop(reply.number, None)
            if waiting is not None:
                waiting.reply = reply
        if self._helper is not helper:
            helper.end()  # given up while this thread listened to it
        elif fault:
            self._failed(fault)
        self._state.notify_all()
        return bool(replies or fault)

    def _failed(self, why: str) -> None:
        self._faults += 1
        logger.warning("the process that draws the twin's images failed: %s %s", why, self._ended())

    def _ended(self) -> str:
        """Give the process up, and leave it to a thread that listens to it to clear it away."""
        helper, self._helper = self._helper, None
        self._wanted.clear()
        self._ahead.clear()
        self._state.notify_all()
        if helper is None:
            return ""
        if self._receiving:
            helper.kill()
            return ""
        return helper.end()


_process: Final = DrawingProcess()
atexit.register(_process.end)


def drawing_process() -> DrawingProcess:
    """Return the one that all scenes of this program share."""
    return _process
