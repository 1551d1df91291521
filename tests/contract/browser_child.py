"""Opens an address in a browser until a text is shown, and prints what is shown then."""

import os
import sys

os.environ |= {"QTWEBENGINE_CHROMIUM_FLAGS": "--disable-gpu", "QTWEBENGINE_DISABLE_SANDBOX": "1"}

from PySide6.QtCore import QTimer, QUrl
from PySide6.QtWebEngineWidgets import QWebEngineView
from PySide6.QtWidgets import QApplication

LOOK_MS, LONGEST_MS = 300, 40_000

address, wanted = sys.argv[1:]
application = QApplication(["browser"])
view = QWebEngineView()
view.resize(1200, 900)
view.show()
view.load(QUrl(address))
shown = [""]


def heard(text: object) -> None:
    shown.append(str(text))
    if wanted in shown[-1]:
        application.quit()


look = QTimer()
look.timeout.connect(lambda: view.page().runJavaScript("document.body.innerText", heard))
look.start(LOOK_MS)
QTimer.singleShot(LONGEST_MS, application.quit)
application.exec()
sys.stdout.write(shown[-1])
sys.stdout.flush()
os._exit(0)  # what Chromium leaves behind is nobody's concern
