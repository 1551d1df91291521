"""The process-wide hooks that bring stray exceptions and Qt's own messages to the policy."""

import logging
import sys
import threading
from collections.abc import Callable
from types import TracebackType

from PySide6.QtCore import QMessageLogContext, QtMsgType, qInstallMessageHandler

from cosmic.frame import overrides
from cosmic.frame.failure import FailurePolicy

qt_logger = logging.getLogger("cosmic.qt")

_QT_LEVELS = {
    QtMsgType.QtDebugMsg: logging.DEBUG,
    QtMsgType.QtInfoMsg: logging.INFO,
    QtMsgType.QtWarningMsg: logging.WARNING,
    QtMsgType.QtCriticalMsg: logging.ERROR,
    QtMsgType.QtFatalMsg: logging.CRITICAL,
}


def install_hooks(policy: FailurePolicy) -> Callable[[], None]:
    """Send what nothing caught to `policy`; returns the function that undoes it. GUI thread.

    PySide6 hands an exception in a slot, a timer or an overridden method such as `paintEvent`
    to `sys.excepthook`, after which Qt goes on; so this is the one place that sees them all.
    """
    before = (sys.excepthook, threading.excepthook, sys.unraisablehook)

    def on_exception(
        kind: type[BaseException], error: BaseException, trace: TracebackType | None
    ) -> None:
        if isinstance(error, (KeyboardInterrupt, SystemExit)):
            before[0](kind, error, trace)
            return
        policy.report(error.with_traceback(trace), _where_in(trace))

    def on_thread_exception(args: threading.ExceptHookArgs) -> None:
        if args.exc_value is not None:
            name = args.thread.name if args.thread else "?"
            policy.report(args.exc_value, f"thread {name!r}", thread_died=True)

    def on_unraisable(args: "sys.UnraisableHookArgs") -> None:
        if args.exc_value is not None:
            policy.report(args.exc_value, args.err_msg or "callback")

    def on_qt_message(kind: QtMsgType, context: QMessageLogContext, message: str) -> None:  # noqa: ARG001
        qt_logger.log(_QT_LEVELS.get(kind, logging.WARNING), "%s", message)

    sys.excepthook, threading.excepthook = on_exception, on_thread_exception
    sys.unraisablehook = on_unraisable
    qt_before = qInstallMessageHandler(on_qt_message)

    def undo() -> None:
        sys.excepthook, threading.excepthook, sys.unraisablehook = before
        qInstallMessageHandler(qt_before)

    return undo


def _where_in(trace: TracebackType | None) -> str:
    """Name the innermost function of CoSMic that was running, or the outermost of all."""
    where = ""
    while trace is not None:
        module = str(trace.tb_frame.f_globals.get("__name__", "?"))
        if module != overrides.__name__ and (module.startswith("cosmic.") or not where):
            where = f"{module}.{trace.tb_frame.f_code.co_qualname}"
        trace = trace.tb_next
    return where or "window"
