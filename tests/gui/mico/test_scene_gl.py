"""The scene in OpenGL, in processes of their own on a virtual display (software rendering)."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent

pytestmark = pytest.mark.skipif(
    shutil.which("Xvfb") is None, reason="needs a virtual display: install Xvfb and Mesa"
)


@pytest.fixture(scope="module")
def display():
    """The number of a virtual display, such as ":7"."""
    read, write = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), "-screen", "0", "1280x900x24"],
        pass_fds=(write,),
        stderr=subprocess.DEVNULL,
    )
    os.close(write)
    with os.fdopen(read) as answer:
        number = answer.readline().strip()
    if not number:
        server.wait(10)
        pytest.skip("Xvfb does not start here")
    yield f":{number}"
    server.terminate()
    server.wait(10)


def run(display, check, **environment):
    """Run one check of the child on the display."""
    folders = os.pathsep.join([str(HERE.parents[1]), *sys.path])
    done = subprocess.run(
        [sys.executable, str(HERE / "scene_gl_child.py"), check],
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
        env=os.environ
        | {"DISPLAY": display, "QT_QPA_PLATFORM": "xcb", "PYTHONPATH": folders}
        | environment,
    )
    assert (done.returncode, done.stdout) == (0, "fine\n"), done.stderr + done.stdout
    assert done.stderr == ""


def test_a_scene_is_drawn_lit_moved_and_picked(display):
    run(display, "all")


def test_without_opengl_on_a_display_it_falls_back_in_silence(display):
    run(display, "without", QT_XCB_GL_INTEGRATION="none")
